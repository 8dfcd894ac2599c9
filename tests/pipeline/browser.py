"""Pages looked at in a real browser, Debian's Chromium: nothing is fetched, and nothing is complained of."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Page, sync_playwright

CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no browser: install chromium (Debian: apt-get install chromium), then run again"
)
#: Patience with the page [ms]: a loaded machine takes seconds to paint it.
PATIENCE = 60_000


@contextmanager
def opened(file: Path, *, width: int = 1100, scheme: str = "light") -> Iterator[Page]:
    """Yield a page once its plots are painted; at the end nothing was fetched and the console is empty."""
    told: list[str] = []
    with sync_playwright() as playwright:
        # No sandbox within a sandbox: tests run as root in containers, and the page is our own.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: told.append(message.text) if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: told.append(str(error)))
        page.on("request", lambda request: told.append(request.url) if request.url.startswith("http") else None)
        page.goto(file.resolve().as_uri())
        page.wait_for_function("window.Bokeh && Bokeh.documents.length && Bokeh.documents.every((own) => own.is_idle)")
        yield page
        browser.close()
    assert told == []
