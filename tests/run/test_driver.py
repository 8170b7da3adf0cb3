"""The driver of the official modules reads Blender's command line as Blender does."""

from __future__ import annotations

import bpy_driver
import pytest


def test_options_keep_their_order_and_end_at_two_dashes() -> None:
    words = ["-b", "a.blend", "-E", "TALBOT", "-o", "//out", "-f", "1", "--python", "s.py", "--", "-f", "2"]
    assert bpy_driver.parse(words) == [
        ("-b", ""),
        ("", "a.blend"),
        ("-E", "TALBOT"),
        ("-o", "//out"),
        ("-f", "1"),
        ("--python", "s.py"),
    ]


def test_negative_values_belong_to_their_option() -> None:
    assert bpy_driver.parse(["-s", "-3"]) == [("-s", "-3")]


@pytest.mark.parametrize("words", [["--window-fullscreen"], ["-b", "-o"]])
def test_what_the_module_cannot_do_is_refused(words: list[str]) -> None:
    with pytest.raises(bpy_driver.CommandError) as error:
        bpy_driver.parse(words)
    assert error.value.code == 2
    assert words[-1] in str(error.value)


@pytest.mark.parametrize(
    ("text", "frames"),
    [("7", [7]), ("1,3,5..7", [1, 3, 5, 6, 7]), ("+2", [12]), ("-1", [20]), ("-2..-1", [19, 20]), ("+0..+1", [10, 11])],
)
def test_frames(text: str, frames: list[int]) -> None:
    assert bpy_driver.parse_frames(text, 10, 20) == frames


def test_no_frames_is_an_error() -> None:
    with pytest.raises(bpy_driver.CommandError):
        bpy_driver.parse_frames("one", 1, 2)
