"""Pages of views in headless Chromium, for tests that look at them as a user does."""

import os
import shutil
from contextlib import contextmanager
from importlib.util import find_spec

import pytest

#: Where Debian, Fedora and Chrome's own packages put it.
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SECONDS = 60


def why_not():
    """Return why no browser can be driven; empty where one can."""
    missing = [name for name in ("bokeh", "selenium") if find_spec(name) is None]
    if missing:
        return f"{missing[0]} is not installed: pip install '.[test]'"
    if not (any(map(shutil.which, BROWSERS)) and shutil.which("chromedriver")):
        return "no Chromium with its driver here: apt-get install chromium chromium-driver"
    return ""


in_browser = pytest.mark.skipif(bool(why_not()), reason=why_not() or "there is a browser")


@contextmanager
def browser(width=1300, height=1000):
    """Drive a headless browser that has no network."""
    from selenium import webdriver  # noqa: PLC0415  not everyone has it
    from selenium.webdriver.chrome.service import Service  # noqa: PLC0415

    options = webdriver.ChromeOptions()
    options.binary_location = next(filter(None, map(shutil.which, BROWSERS)))
    switches = ["headless=new", "disable-gpu", "disable-dev-shm-usage"]
    switches += [f"window-size={width},{height}", "host-resolver-rules=MAP * ~NOTFOUND"]
    switches += ["no-sandbox"] if os.name == "posix" and os.geteuid() == 0 else []
    for switch in switches:
        options.add_argument(f"--{switch}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.set_script_timeout(SECONDS)
    try:
        yield driver
    finally:
        driver.quit()


READY = """
const done = arguments[0];
(function look() { window.pwscont && pwscont.isReady ? done(true) : setTimeout(look, 20); })();
"""


def opened(driver, path):
    """Open a page and wait until it is drawn."""
    driver.get(path.resolve().as_uri())
    assert driver.execute_async_script(READY)


def complaints(driver):
    """Return what the console says that is more than information."""
    return [row["message"] for row in driver.get_log("browser") if row["level"] != "INFO"]


def drawn(driver, name):
    """Return the numbers of a source of Bokeh, as lists."""
    code = """
    const plain = (some) => ArrayBuffer.isView(some) ? Array.from(some) : some;
    const data = pwscont.find(arguments[0]).data;
    return Object.fromEntries(Object.entries(data).map(([key, some]) => [key, plain(some)]));
    """
    return driver.execute_script(code, name)
