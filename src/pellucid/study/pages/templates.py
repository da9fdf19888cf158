"""Fill in the templates that all pages of a report share."""

from __future__ import annotations

from importlib.metadata import version

from markupsafe import Markup

from ..drawing.style import SANS_SERIF_FONTS, css_variables
from .values import marked_up, plain_text


def render(template: str, **content: object) -> str:
    """Fill in a template of this folder."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, ""),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_finalize,
    )
    environment.filters["plain"] = plain_text
    environment.filters["commands"] = _commands
    look = {
        "version": version("pellucid"),
        "light": css_variables(),
        "dark": css_variables(dark=True),
        "sans": SANS_SERIF_FONTS,
    }
    return environment.get_template(template).render(**look, **content)


def _finalize(shown: object) -> object:
    """Return what a template shows, with the values in plain text marked up."""
    return marked_up(shown) if isinstance(shown, str) and not isinstance(shown, Markup) else shown


def _commands(text: str) -> Markup:
    """Return a sentence as HTML, with what stands between backticks as code."""
    parts = text.split("`")
    return Markup("").join(
        Markup("<code>{}</code>").format(_unbroken(part)) if i % 2 else marked_up(part) for i, part in enumerate(parts)
    )


def _unbroken(command: str) -> Markup:
    """Return a command as HTML in which no line breaks between the dashes of an option."""
    option = Markup('<span class="option">{}</span>')
    return Markup(" ").join(option.format(word) if word.startswith("--") else word for word in command.split(" "))
