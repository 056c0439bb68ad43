"""A headless Chromium without network, for the tests of pages."""

import contextlib
import shutil
from pathlib import Path

import pytest

FLAGS = """--headless=new --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-sync
--disable-component-update --window-size=1200,1000 --proxy-server=127.0.0.1:9""".split()


@contextlib.contextmanager
def chromium(folder: Path):
    """A selenium driver; the test is skipped where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver")
    programs = [shutil.which(name) for name in ("chromium", "chromedriver")]
    if None in programs:
        pytest.skip("needs chromium and chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    for flag in (*FLAGS, f"--user-data-dir={folder}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(programs[1]))
    try:
        yield driver
    finally:
        driver.quit()


def complaints(driver) -> list:
    """What the console says, and every file that a page has asked for."""
    return driver.get_log("browser") + driver.execute_script("return performance.getEntriesByType('resource')")
