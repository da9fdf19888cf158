"""The public names and their modules. Type checkers read them, and `__init__.py` imports each when it is first used."""

import pellucid_lab

from ._errors import PellucidError as PellucidError
from .arm.study.fit_robot import fit_robot as fit_robot
from .arm.urdf import read_robot as read_robot
from .controllers.control_law import Limits as Limits
from .controllers.controller import controller as controller
from .controllers.controller import controllers as controllers
from .controllers.export.export import export as export
from .controllers.instruments import Instruments as Instruments
from .controllers.study.commission import commission as commission
from .controllers.study.incident import incident as incident
from .controllers.supervised import supervised as supervised
from .emg.estimators.calibrate_muscles import calibrate_muscles as calibrate_muscles
from .emg.estimators.torque_regressor import TorqueRegressor as TorqueRegressor
from .emg.models.muscle import Muscle as Muscle
from .emg.signals.electromechanical_delay import electromechanical_delay as electromechanical_delay
from .emg.signals.electromechanical_delay import median_frequency_trend as median_frequency_trend
from .emg.signals.emg_chain import envelope as envelope
from .emg.signals.emg_findings import emg_quality as emg_quality
from .emg.signals.emg_scale import maximal_envelope as maximal_envelope
from .emg.signals.repetitions import stride_ensemble as stride_ensemble
from .files.raw_emg import RawEmg as RawEmg
from .files.readers import read as read
from .joint.study.fit_joint import fit_joint as fit_joint
from .models import cards as cards
from .orthosis.imu.hinge import fit_hinge as fit_hinge
from .orthosis.strap.identified_strap import fit_strap as fit_strap
from .orthosis.transfer.fit_transfer_function import fit_transfer_function as fit_transfer_function
from .people.certify import certify as certify
from .people.comparison import compare_conditions as compare_conditions
from .people.movement_indices import movement_indices as movement_indices
from .people.power import plan as plan
from .people.power import power_curve as power_curve
from .start.log_proposal import propose as propose
from .start_study import init as init
from .study import datasets as datasets
from .study.procedures.audit import audit as audit
from .study.procedures.compare import compare as compare
from .study.procedures.registry import open_study
from .study.procedures.run import activations as activations
from .study.procedures.run import assess as assess
from .study.procedures.run import calibrate as calibrate
from .study.procedures.run import check as check
from .study.procedures.run import cocontraction as cocontraction
from .study.procedures.run import identify as identify
from .study.procedures.run import onset as onset
from .study.procedures.run import report as report
from .study.procedures.run import synergies as synergies

open = open_study

demo = pellucid_lab.demo
predict = pellucid_lab.predict
reproduce = pellucid_lab.reproduce
simulate = pellucid_lab.simulate

__version__: str
