"""The first screen: examples with pictures, and the tour."""

import pytest

pytestmark = pytest.mark.browser


def test_a_page_of_nothing_begins_with_the_examples(serve, tab):
    one = tab(serve().link)
    one.page.wait_for_selector("[data-example=tidy_desk] img")
    broken = "[...document.querySelectorAll('.card img')].filter((one) => one.complete && !one.naturalWidth).length"
    assert one.page.evaluate(broken) == 0
    one.page.screenshot(path="build/screenshots/welcome.png")
    one.page.click("[data-example=tidy_desk]")
    one.until("$.spec && $.spec.objects.length > 4 && !document.querySelector('dialog')")
    one.ready()
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("y")
    one.page.wait_for_selector("dialog[open]")
    one.page.keyboard.press("t")  # no shortcut of the page below
    assert one.page.evaluate("document.documentElement.dataset.theme") != "dark"
    one.page.keyboard.press("Escape")
    one.until("!document.querySelector('dialog')")
    assert "phone" in one.page.inner_text(".cm-content")


def test_a_page_of_a_spec_does_not(served, tab):
    one = tab(served.link)
    one.ready()
    assert one.page.query_selector("dialog") is None


def test_the_tour_goes_from_the_text_to_the_download(serve, tab):
    one = tab(serve().link)
    one.page.click("text=Take the tour")
    seen = []
    while one.page.query_selector(".tour"):
        seen.append(one.page.inner_text(".tour h2"))
        one.page.wait_for_timeout(150)
        ring = one.page.locator(".ring").bounding_box()
        assert ring["width"] > 200 and ring["height"] > 30
        one.page.click(".tour .strong")
    assert [title[0] for title in seen] == list("12345")
    one.page.keyboard.press("?")
    one.page.click(".offers >> text=Take the tour")
    one.page.wait_for_selector(".tour")
    one.page.keyboard.press("Escape")
    one.until("!document.querySelector('.tour')")
