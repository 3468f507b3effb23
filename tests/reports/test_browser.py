"""The page in a real browser: no complaint, tables that sort by mouse and keyboard, light and dark."""

import io
import json
import shutil
import time

import numpy as np
import pytest
from PIL import Image

from kine2go_warp.reports.report import write_report

pytestmark = pytest.mark.slow

NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    program = next((found for name in NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on the PATH")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        one = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield one
        one.close()


@pytest.fixture
def opened(browser, report):
    """Opens the report, and fails if the browser has anything to say about it or asks for anything."""
    said, pages = [], []

    def open_page(scheme="light", width=1280):
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if request.url.startswith("http") else None)
        page.goto(report.as_uri())
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert said == []


@pytest.fixture(scope="module")
def large(walks, tmp_path_factory):
    """The report of 40 motions."""
    folder = tmp_path_factory.mktemp("large")
    for number in range(40):
        shutil.copytree(walks / ("walk", "stroll")[number % 2], folder / "forty.zarr" / f"motion_{number:02d}")
    root = json.loads((walks / "zarr.json").read_text())
    root.pop("consolidated_metadata", None)
    (folder / "forty.zarr" / "zarr.json").write_text(json.dumps(root))
    write_report(folder / "forty.zarr", folder / "forty.html", pictures=False)
    return folder / "forty.html"


def test_forty_motions_have_an_index_that_filters_and_unfolds(browser, large):
    said, page = [], browser.new_page(viewport={"width": 1280, "height": 900})
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(large.as_uri())
    assert page.evaluate("document.documentElement.scrollHeight") < 20_000
    assert page.locator("details.motion[open]").count() == 0
    page.fill("#filter", "motion_1")
    assert page.inner_text("#found") == "10 of 40 motions"
    for shown in (".cards li:visible", "article:visible", "#scorecard tbody tr:visible"):
        assert page.locator(shown).count() == 10
    page.fill("#filter", "")
    page.locator(".cards a").nth(3).click()
    page.wait_for_selector("#motion-motion_03 details.motion[open]")
    assert page.locator("details.motion[open]").count() == 1
    page.set_viewport_size({"width": 360, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    assert said == []
    page.close()


def shown_motions(page):
    return page.locator("#scorecard tbody th").all_inner_texts()


def test_a_heading_sorts_upwards_then_downwards(opened):
    page = opened()
    heading = page.locator("#scorecard th", has_text="trajectories")
    motion = page.locator("#scorecard thead th").first
    assert shown_motions(page) == ["stroll", "walk"]
    motion.get_by_role("button").click()
    assert shown_motions(page) == ["stroll", "walk"]
    assert motion.get_attribute("aria-sort") == "ascending"
    motion.get_by_role("button").click()
    assert shown_motions(page) == ["walk", "stroll"]
    assert motion.get_attribute("aria-sort") == "descending"
    heading.get_by_role("button").click()
    assert motion.get_attribute("aria-sort") is None


def test_numbers_are_sorted_as_numbers(opened):
    page = opened()
    column = page.locator("#scorecard thead th").all_inner_texts().index("duration s".replace(" ", "\n"))
    page.locator("#scorecard thead th").nth(column).get_by_role("button").click()
    values = page.locator(f"#scorecard tbody td:nth-child({column + 1})").all_inner_texts()
    assert [float(value) for value in values] == sorted(float(value) for value in values)
    assert shown_motions(page)[0] == "stroll"


def test_tables_sort_from_the_keyboard(opened):
    page = opened()
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.tagName") == "BUTTON":
            break
    page.keyboard.press("Enter")
    page.keyboard.press("Space")
    assert shown_motions(page) == ["walk", "stroll"]


@pytest.mark.usefixtures("can_draw")
def test_all_pictures_load(opened):
    page = opened()
    widths = page.evaluate("[...document.images].map(image => image.complete && image.naturalWidth)")
    assert widths == [320] * 18


@pytest.mark.usefixtures("can_draw")
def test_a_film_plays_where_the_pictures_were_and_stops(opened):
    page = opened()
    button = page.locator("button.film").first
    button.click()
    canvas = page.locator("canvas.film")
    # The page forbids the eval that playwright's own waiting needs.
    end = time.monotonic() + 30.0
    while not page.evaluate("document.querySelector('canvas.film').dataset.picture > 2"):
        assert time.monotonic() < end, "the film stands still"
        page.wait_for_timeout(100.0)
    inked = (
        "[...document.querySelector('canvas.film').getContext('2d').getImageData(0, 0, 640, 240).data].some(Boolean)"
    )
    assert page.evaluate(inked)
    assert page.locator(".shots:visible").count() == 5
    button.click()
    assert canvas.count() == 0
    assert page.locator(".shots:visible").count() == 6


@pytest.mark.parametrize("width", [360, 390, 768, 1280, 2200])
def test_the_page_is_as_wide_as_the_screen(opened, width):
    page = opened(width=width)
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    assert page.evaluate("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize(("scheme", "background"), [("light", 246), ("dark", 18)])
def test_text_and_plots_stand_out_from_the_background(opened, scheme, background):
    page = opened(scheme)
    for place in ("h1", "#scorecard tbody", ".plots figure:first-child svg", ".plots figure:last-child svg"):
        picture = np.asarray(Image.open(io.BytesIO(page.locator(place).first.screenshot())).convert("L")).astype(int)
        contrast = np.abs(picture - np.median(picture))
        assert (contrast > 60).mean() > 0.005, place
    corner = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))[0, 0, 0]
    assert corner == background
