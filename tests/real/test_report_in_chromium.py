"""The report opened in a real browser: it parses, draws, fits a phone, and nothing is reported as broken."""

import os
import re
import shutil
import subprocess

import numpy as np
import pytest

from pellucid.study.procedures.run import report as write_report

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars",
    "--enable-logging=stderr", "--log-level=0",
)  # fmt: skip


@pytest.fixture(scope="module")
def browser() -> str:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is installed")
    return found


@pytest.fixture(scope="module")
def page(emps_study, emps_fit):
    return write_report(emps_study, emps_fit)


def visit(browser, tmp_path, page, *options):
    """Standard output, and what the page's console said."""
    command = [browser, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", *options, page.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, env={**os.environ, "LANG": "C.UTF-8"})
    assert run.returncode == 0, run.stderr
    return run.stdout, [line for line in run.stderr.splitlines() if "CONSOLE" in line]


def test_the_page_is_read_as_it_was_written(browser, page, tmp_path):
    dom, console = visit(browser, tmp_path, page, "--dump-dom")
    assert console == []
    assert re.search(r"<title>emps: identified joint</title>", dom)
    written = page.read_text(encoding="utf-8")
    assert dom.count("<svg") == written.count("<svg") >= 8
    assert dom.count("<table") == written.count("<table")
    assert dom.rstrip().endswith("</html>")
    assert "nan" not in re.sub(r"<[^>]*>", " ", re.sub(r"<style.*?</style>", "", dom, flags=re.DOTALL)).lower().split()


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, False), (1280, True)], ids=["desk", "phone", "dark"])
def test_the_page_shows(browser, page, tmp_path, width, dark):
    from matplotlib.image import imread

    picture = tmp_path / "page.png"
    options = [f"--screenshot={picture}", f"--window-size={width},3000"] + ["--force-dark-mode"] * dark
    _, console = visit(browser, tmp_path, page, *options)
    assert console == []
    pixels = imread(picture)[..., :3]
    assert pixels.shape[1] == width
    paper = pixels[2, 2]
    assert (paper.mean() < 0.2) == dark
    # Something is drawn in every fifth of the page, and in several colours.
    inked = np.abs(pixels - paper).max(axis=2) > 0.15
    assert all(part.mean() > 0.005 for part in np.array_split(inked, 5))
    assert len(np.unique((pixels[::4, ::4].reshape(-1, 3) * 15).astype(int), axis=0)) > 20
