"""A scripted browser that plays participant and operator: Playwright, on the Chromium of the system."""

import asyncio
import os
import shutil
import threading
import time
import traceback
from contextlib import contextmanager
from pathlib import Path

import pytest

from pellucid.live.session.live_session import Phase
from pellucid.live.session.page_server import PageServer

CHROMIUM = next((path for name in ("chromium", "chromium-browser", "chrome") if (path := shutil.which(name))), "")
"""The browser of this system; "" for none."""

WIDTH, HEIGHT = 1280, 860
NARROW_PX = 420
"""Width of the window of a telephone."""

CUT_SCRIPT = """() => {
  const found = [];
  if (document.documentElement.scrollWidth > innerWidth) found.push('the page scrolls sideways');
  for (const one of document.querySelectorAll('body *')) {
    const box = one.getBoundingClientRect(), name = `${one.tagName} ${one.id} ${one.textContent.trim().slice(0, 40)}`;
    if (!box.width) continue;
    if (box.right > innerWidth + 1 || box.left < -1) found.push(name);
    const hides = getComputedStyle(one).overflowX === 'hidden';
    if (hides && one.scrollWidth > one.clientWidth + 1) found.push(`cut: ${name}`);
  }
  for (const one of document.querySelectorAll('.words:not([hidden])'))
    if (one.firstElementChild.getBoundingClientRect().top < 0) found.push(`above the window: ${one.id}`);
  return found;
}"""
"""Script that lists what of a page is cut or wider than its window."""

PATIENCE_S = 180.0


@contextmanager
def served(session):
    """Serve a session's pages from a thread, until the block ends."""
    server, opened, failed = PageServer(session), threading.Event(), []

    def run():
        try:
            asyncio.run(server.run(lambda server: opened.set()))
        except BaseException as error:
            failed.append(error)
            traceback.print_exc()
            opened.set()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert opened.wait(PATIENCE_S)
        yield server
    finally:
        server.end()
        thread.join(PATIENCE_S)
    assert not failed, failed


@contextmanager
def browser():
    """Open the system's browser without a window."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install playwright")
    if not CHROMIUM:
        pytest.skip("needs Chromium")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        try:
            yield opened
        finally:
            opened.close()


class Players:
    """An operator and a participant, each with a page."""

    def __init__(self, opened, server):
        self.server, self.session = server, server.session
        self.errors: list[str] = []
        self.used: set[str] = set()  # controls that were used, by their names on the pages
        self.operator = self._page(opened, "operator")
        self.participant = self._page(opened, "participant")

    def _page(self, opened, role):
        page = opened.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(1e3 * PATIENCE_S)
        page.on("pageerror", lambda error: self.errors.append(f"{role}: {error}"))
        page.on("console", lambda said: self.errors.append(f"{role}: {said.text}") if said.type == "error" else None)
        page.on("request", lambda request: self._local(request.url))
        page.goto(self.server.address(role))
        return page

    def _local(self, url):
        if not url.startswith((f"http://127.0.0.1:{self.server.port}/", "data:")):
            self.errors.append(f"a request left this computer: {url}")

    def wait(self, done, patience=PATIENCE_S):
        """Wait until `done()`."""
        end = time.monotonic() + patience
        while not done():
            session = self.session
            assert time.monotonic() < end, (session.phase, session.reason, session.faults, session.notes, self.errors)
            self.operator.wait_for_timeout(40)

    def do(self, control):
        """Use one of the operator's buttons."""
        self.used.add(control)
        self.operator.click(f"#{control}", no_wait_after=True)

    def follow(self, link, said):
        """Follow one of the operator's links, and wait until its page says something."""
        self.used.add(link)
        with self.operator.context.expect_page() as opened:
            self.operator.click(f"#{link}")
        page = opened.value
        page.wait_for_load_state()
        self.wait(lambda: said in page.content())
        page.close()

    def slide(self, torque):
        """Move the slider, and wait until the session has its torque."""
        self.used.add("torque")
        self.operator.fill("#torque", str(torque))
        self.wait(lambda: self.session.slider == torque)

    def accept_or_repeat(self):
        """Do what the operator's page advises after a trial, and wait until it is done."""
        self.do("repeat" if self.session.reason else "accept")
        self.wait(lambda: self.session.phase != Phase.judged)

    def try_to(self, page, control):
        """Use a button if it is there; it may have gone meanwhile."""
        # Within the page, so that nothing changes between the look and the click.
        click = "(id) => { const it = document.getElementById(id); return !!it.offsetParent && (it.click(), true); }"
        if page.evaluate(click, control):
            self.used.add(control)

    def until_running(self, share=0.0):
        """Do what is asked for until a trial runs and a share of it is done."""

        def runs():
            self._go_on()
            if self.session.phase == Phase.judged:  # a busy computer's silence stopped the trial before
                self.try_to(self.operator, "repeat")
            attempt = self.session.attempt
            return self.session.phase == Phase.running and attempt is not None and attempt.task.progress >= share

        self.wait(runs)

    def take_pictures(self, name):
        """Keep pictures of both pages, where the variable PELLUCID_PICTURES names a folder for them."""
        folder = os.environ.get("PELLUCID_PICTURES")
        if folder:
            self.operator.evaluate("document.getElementById('refused').hidden = true")
            for role, page in (("participant", self.participant), ("operator", self.operator)):
                page.screenshot(path=Path(folder) / f"live_{role}_{name}.png")

    def cut_elements(self, width):
        """Return what is cut or wider than the window on both pages at a `width` [px]."""
        found = []
        for role, page in (("operator", self.operator), ("participant", self.participant)):
            page.set_viewport_size({"width": width, "height": HEIGHT})
            page.wait_for_timeout(400)
            found += [f"{role}: {text}" for text in page.evaluate(CUT_SCRIPT)]
            page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
        return found

    def until_judged(self):
        """Wait for the end of the trial, and for the button that goes on."""
        self.wait(lambda: self.session.phase == Phase.judged and self.operator.is_visible("#accept"))

    def until_finished(self, patience=PATIENCE_S):
        """Play the rest of the session."""

        def finished():
            self._go_on()
            if self.session.phase == Phase.judged:
                self.try_to(self.operator, "repeat" if self.session.reason else "accept")
            return self.session.phase == Phase.finished

        self.wait(finished, patience)

    def _go_on(self):
        """Do what the session waits for now."""
        phase = self.session.phase
        if phase in (Phase.consent, Phase.instructions):
            self.try_to(self.participant, "yes")
        elif phase == Phase.waiting:
            self.try_to(self.operator, "reset")
            self.try_to(self.operator, "start")
        elif phase == Phase.rest:
            self.try_to(self.operator, "skip_rest")
