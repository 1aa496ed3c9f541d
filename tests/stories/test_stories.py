"""Every story on both dialects: it ends, no vehicle is commanded that should not be, and every line is true.

`./scripts/stories` flies all of them; the ordinary suite a sample.
"""

from __future__ import annotations

import pytest

from tests.stories.judge import Judge, told_in
from tests.stories.stories import STORIES
from tests.stories.story import Story
from tests.stories.world import flown

LOOPTIME = pytest.mark.looptime(noop_cycles=2)
DIALECTS = ("ardupilot", "px4")
SAMPLE = 4
"""Every so many-th story is flown with the ordinary suite, in one dialect after the other."""

ALL = [(story, autopilot) for story in STORIES for autopilot in DIALECTS]
SOME = [(story, DIALECTS[number % 2]) for number, story in enumerate(STORIES[::SAMPLE])]


def name_of(value: object) -> str:
    return value.name.replace(" ", "-") if isinstance(value, Story) else str(value)


async def judged(story: Story, autopilot: str) -> None:
    told = await flown(story, autopilot)
    findings = Judge(told).findings()
    assert not findings, "\n".join([*map(str, findings), "", told_in(told)])


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize(("story", "autopilot"), SOME, ids=name_of)
async def test_a_sample_of_the_stories(story: Story, autopilot: str) -> None:
    await judged(story, autopilot)


@pytest.mark.asyncio
@pytest.mark.campaign
@LOOPTIME
@pytest.mark.parametrize(("story", "autopilot"), ALL, ids=name_of)
async def test_a_story(story: Story, autopilot: str) -> None:
    await judged(story, autopilot)


def test_the_stories_can_be_distinguished() -> None:
    assert len({story.name for story in STORIES}) == len(STORIES) >= 40
