"""What waits for the broker, against a model: nothing is lost without being counted, and the newest state wins."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from executor.adapters.mqtt.client import MqttMessage, Outbox

BOUND = 5
ROWS, CELLS = ("event", "fault"), ("state/a", "state/b", "state/c", "plan")


class Post(RuleBasedStateMachine):
    """Puts messages in, takes some out, and lets some of those fail."""

    def __init__(self) -> None:
        super().__init__()
        self.outbox = Outbox(BOUND)
        self.count = 0
        self.kept: dict[str, int] = dict.fromkeys(ROWS, 0)
        self.arrived: dict[str, list[int]] = {topic: [] for topic in (*ROWS, *CELLS)}
        self.newest: dict[str, int] = {}
        self.sent: dict[str, int] = {}
        self.under_way: list[MqttMessage] = []

    def letter(self, topic: str) -> MqttMessage:
        self.count += 1
        return MqttMessage(topic, b"%d" % self.count, retain=topic == "plan")

    @rule(topic=st.sampled_from(ROWS))
    def keep(self, topic: str) -> None:
        self.outbox.enqueue(self.letter(topic))
        self.kept[topic] += 1

    @rule(topic=st.sampled_from(CELLS))
    def renew(self, topic: str) -> None:
        self.outbox.put_latest(self.letter(topic))
        self.newest[topic] = self.count

    @precondition(lambda self: not self.under_way)
    @rule(most=st.integers(1, 8))
    def take(self, most: int) -> None:
        before = len(self.outbox)
        self.under_way = self.outbox.take_batch(most)
        assert len(self.under_way) == min(most, before)

    @precondition(lambda self: self.under_way)
    @rule(outcomes=st.lists(st.booleans(), min_size=8, max_size=8))
    def end(self, outcomes: list[bool]) -> None:
        failed = []
        for one, arrived in zip(self.under_way, outcomes, strict=False):
            if arrived:
                self.arrived[one.topic].append(int(one.payload))
            else:
                failed.append(one)
        self.outbox.return_unsent(failed)
        self.under_way = []

    @rule()
    def reconnect(self) -> None:
        self.outbox.resend_retained()

    @invariant()
    def nothing_is_lost_without_being_counted(self) -> None:
        for topic in ROWS:
            flying = sum(one.topic == topic for one in self.under_way)
            waiting = sum(one.topic == topic for one in self.outbox._row)
            known = len(self.arrived[topic]) + flying + waiting + self.outbox.dropped.get(topic, 0)
            assert known == self.kept[topic]
            assert waiting <= BOUND

    @invariant()
    def rows_arrive_in_their_order_and_cells_never_go_back(self) -> None:
        for topic in ROWS:
            assert len(set(self.arrived[topic])) == len(self.arrived[topic])
        for topic in CELLS:
            assert self.arrived[topic] == sorted(self.arrived[topic])

    def teardown(self) -> None:
        self.outbox.return_unsent(self.under_way)
        while taken := self.outbox.take_batch(3):
            for one in taken:
                self.arrived[one.topic].append(int(one.payload))
        for topic, number in self.newest.items():
            assert self.arrived[topic][-1] == number


Post.TestCase.settings = settings(max_examples=30, stateful_step_count=40)
test_the_outbox = Post.TestCase


@given(st.lists(st.sampled_from((*ROWS, *CELLS)), max_size=60), st.integers(1, 10))
def test_neither_kind_starves_the_other(topics: list[str], most: int) -> None:
    outbox = Outbox()
    for topic in topics:
        (outbox.enqueue if topic in ROWS else outbox.put_latest)(MqttMessage(topic, b""))
    cells, rows = len(set(topics) & set(CELLS)), sum(topic in ROWS for topic in topics)
    taken = outbox.take_batch(most)
    given_cells = sum(one.topic in CELLS for one in taken)
    assert len(taken) == min(most, cells + rows)
    assert given_cells >= min(cells, most // 2)
    assert len(taken) - given_cells >= min(rows, most - most // 2)
