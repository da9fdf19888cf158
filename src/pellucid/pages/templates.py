"""Fill in the templates that all pages of a report share."""

from __future__ import annotations

from importlib.metadata import version

from ..drawing.style import SANS_SERIF_FONTS, css_variables


def render(template: str, **content: object) -> str:
    """Fill in a template of this folder."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, ""),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    look = {
        "version": version("pellucid"),
        "light": css_variables(),
        "dark": css_variables(dark=True),
        "sans": SANS_SERIF_FONTS,
    }
    return environment.get_template(template).render(**look, **content)
