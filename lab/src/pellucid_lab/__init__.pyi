"""Functions that `pellucid` offers too, each imported when it is first used."""

from .demonstration.demo import demo as demo
from .papers.reproduce import reproduce as reproduce
from .predict import predict as predict
from .simulate import simulate as simulate
