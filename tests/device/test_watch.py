"""The table of reactions: each reading that ends a motion, the value at which it does, and how the motion then ends."""

import math

import pytest

from workbench.device.play.watch import TRIPPED, Reaction, StopError, Watch, WatchOptions
from workbench.robot.servo_profile_file import servo_profile

AX, XL = servo_profile("AX-12A"), servo_profile("XL-430")
"""They work from 9.0 and 6.5 V on; the second has a bus watchdog."""
FINE = {"present_voltage": 111, "present_temperature": 40, "led": 1, "torque_enable": 1, "bus_watchdog": 0}


def watch(profile=AX, options=None) -> Watch:
    made = Watch(profile, {1: "one", 2: "two"}, {1: 75}, options)
    made.begin(0.0)
    return made


@pytest.mark.parametrize(("profile", "values", "alarms", "how", "reason"), [
    (AX, {}, ("electrical shock",), "release", "alarm: electrical shock"),
    (AX, {}, ("current", "electrical shock"), "release", "alarm: current, electrical shock"),
    (AX, {}, ("overload",), "neutral", "alarm: overload"),
    (AX, {}, ("overload", "range", "voltage"), "neutral", "alarm: overload, range"),
    (AX, {"present_temperature": 73}, (), "neutral", "73 deg C, its limit is 75"),
    (AX, {"present_temperature": 40}, ("heat",), "neutral", "40 deg C, its limit is 75"),
    (AX, {"present_voltage": 89}, (), "neutral", "8.9 V, below 9 V"),
    (AX, {"present_voltage": 67}, (), "release", "6.7 V, the supply has failed"),
    (XL, {"present_voltage": 64}, (), "neutral", "6.4 V, below 6.5 V"),
    (AX, {"led": 0}, (), "neutral", "it restarted; did its supply break down?"),
    (AX, {"torque_enable": 0}, (), "neutral", "its torque is off"),
    (XL, {"bus_watchdog": TRIPPED}, (), "neutral", "its bus watchdog stopped it: it heard nothing for too long"),
])
def test_a_reading_that_is_confirmed_ends_the_motion(profile, values, alarms, how, reason):
    w = watch(profile)
    w.answered(1, 0.1, FINE | values, alarms)
    assert w.reaction is None
    w.answered(1, 0.2, FINE | values, alarms)
    assert w.reaction == Reaction(how, f"servo 1 (one): {reason}")
    w.answered(2, 0.3, FINE, ("overload",))
    w.answered(2, 0.4, FINE, ("overload",))
    assert w.reaction.reason.startswith("servo 1"), "the first reaction stays"


@pytest.mark.parametrize(("profile", "values", "alarms"), [
    (AX, {"present_temperature": 72}, ()), (AX, {"present_voltage": 90}, ()), (AX, {}, ("voltage",)),
    (XL, {"bus_watchdog": 254}, ()), (XL, {"bus_watchdog": 0, "present_voltage": 65}, ()), (AX, {"bus_watchdog": TRIPPED}, ())])
def test_a_reading_within_its_limit_ends_nothing(profile, values, alarms):
    w = watch(profile)
    for k in range(10):
        w.answered(1, 0.1 * k, FINE | values, alarms)
    assert w.reaction is None


def test_registers_that_were_not_read_are_not_judged():
    w = watch(XL)
    for k in range(10):
        w.answered(1, 0.1 * k, {}, ())
    assert w.reaction is None


def test_the_limit_of_a_servo_that_states_none_is_70_degrees():
    w = watch()
    for k in range(3):
        w.answered(2, 0.1 * k, {"present_temperature": 67}, ())
    assert w.reaction is None
    for k in range(3):
        w.answered(2, 0.3 + 0.1 * k, {"present_temperature": 68}, ())
    assert w.reaction.reason == "servo 2 (two): 68 deg C, its limit is 70"


def test_each_kind_of_reading_is_confirmed_by_itself_and_a_good_one_resets_the_count():
    w = watch(options=WatchOptions(confirm=3))
    for k, values in enumerate(({"led": 0}, {"torque_enable": 0}, {"led": 0}, {"torque_enable": 0})):
        w.answered(1, 0.1 * k, FINE | values, ())
    for k in range(2):
        w.answered(1, 0.5 + 0.1 * k, FINE | {"led": 0}, ())
    assert w.reaction is None
    w.answered(1, 0.7, FINE | {"led": 0}, ())
    assert w.reaction.how == "neutral"


def test_a_servo_is_silent_when_it_has_left_questions_unanswered_for_0_3_seconds():
    w = watch()
    w.answered(1, 0.1, FINE, ())
    w.answered(2, 0.25, FINE, ())
    w.silent(1, 0.2)
    w.silent(1, 0.39)
    assert (w.failed(1), w.failed(2), w.heard(1), w.heard(2)) == (2, 0, 0.1, 0.25)
    assert w.reaction is None
    w.check(0.41)
    assert w.reaction == Reaction("neutral", "servo 1 (one): silent for 0.3 s")


def test_an_answer_ends_the_silence():
    w = watch()
    w.silent(1, 0.1)
    w.silent(1, 0.2)
    w.answered(1, 0.25, FINE, ())
    w.answered(2, 0.25, FINE, ())
    assert w.failed(1) == 0
    w.check(0.5)
    assert w.reaction is None


@pytest.mark.parametrize("unanswered", [0, 1])
def test_a_servo_that_was_not_asked_often_enough_was_held_up(unanswered):
    w = watch()
    for _ in range(unanswered):
        w.silent(1, 0.1)
    w.check(0.3)
    assert w.reaction == Reaction("neutral", "servo 1 (one): could not be read for 0.3 s, as the computer or the adapter "
                                  "was held up")


def test_a_late_answer_is_held_up_too():
    w = watch()
    w.answered(1, 0.29, FINE, ())
    assert w.reaction is None
    w.answered(1, 0.59, FINE, ())
    assert w.reaction.how == "neutral"
    assert w.reaction.reason.startswith("servo 1 (one): could not be read for 0.3 s")


def test_a_servo_is_unheard_from_its_first_question_on_where_the_motion_has_not_begun():
    w = Watch(AX, {}, {})
    assert w.heard(7) == -math.inf
    w.silent(7, 5.0)
    assert (w.heard(7), w.reaction) == (5.0, None)
    w.silent(7, 5.4)
    assert w.reaction == Reaction("neutral", "servo 7: silent for 0.4 s")


def test_every_servo_is_checked_for_silence():
    w = watch()
    w.answered(1, 0.29, FINE, ())
    w.check(0.31)
    assert w.reaction.reason.startswith("servo 2 (two): could not be read")


def test_the_first_answer_of_a_servo_is_not_late_where_the_motion_has_not_begun():
    w = Watch(AX, {}, {})
    w.answered(7, 5.0, FINE, ())
    assert (w.heard(7), w.reaction) == (5.0, None)


def asked(answers: str, options=None) -> Watch:
    """A servo asked every 40 ms: answered (a), not answered (-), or with an answer that cannot be true (i)."""
    w = watch(options=options)
    for k, how in enumerate(answers):
        time = 0.04 * (k + 1)
        w.answered(2, time, FINE, ())
        if how == "a":
            w.answered(1, time, FINE, ())
        elif how == "i":
            w.impossible(1, time)
        else:
            w.silent(1, time)
    return w


@pytest.mark.parametrize(("answers", "unsteady"), [
    ("a-a-a-a", False), ("a-a-a-a-", True), ("a---aa", False), ("a---aa-", True), ("----a", False), ("aaa----", False),
    ("iiii", False), ("iiiia", True), ("aaaa---", False), ("-aaaaaa-a-a-", False)])
def test_a_servo_that_answers_too_few_questions_may_share_its_id(answers, unsteady):
    """Four of the latest within 0.3 s, and half of them, have no answer that can be true; one that has gone silent is left to
    the check for silence, and one gap may be a restart."""
    w = asked(answers)
    assert (w.doubted == 1) is unsteady
    assert (w.reaction is not None) is unsteady
    if unsteady:
        assert w.reaction.how == "neutral"
        assert "does another servo have its ID" in w.reaction.reason


@pytest.mark.parametrize(("answers", "unsteady"), [("-a-a-a", True), ("aaaa-a-", False), ("aaa-a--", False), ("aa-a-a-", False),
                                                   ("aa-a--", True)])
def test_failures_must_be_a_share_of_all_questions_too(answers, unsteady):
    assert (asked(answers, WatchOptions(failures=3)).doubted is not None) is unsteady


def test_the_reason_counts_answers_and_questions():
    assert asked("a-a-a-a-").reaction.reason == (
        "servo 1 (one): answered only 4 of 8 questions within 0.3 s; is its plug loose, or does another servo have its ID?")


def test_the_questions_of_a_motion_are_counted_from_its_beginning():
    w = asked("a---")
    w.begin(0.17)
    w.silent(1, 0.2)
    w.answered(1, 0.21, FINE, ())
    assert w.doubted is None


def test_on_the_way_back_no_servo_is_doubted():
    w = watch()
    w.only_release()
    for k in range(4):
        w.silent(1, 0.01 * k)
    w.answered(1, 0.05, FINE, ())
    assert (w.doubted, w.reaction) == (None, None)


def test_on_the_way_back_only_reasons_to_release_count():
    w = watch()
    for k in range(2):
        w.answered(1, 0.1 * k, FINE | {"led": 0}, ())
    assert w.reaction.how == "neutral"
    w.answered(1, 0.2, FINE, ("current",))
    w.only_release()
    assert w.reaction is None
    for k in range(3):
        w.answered(1, 0.3 + 0.1 * k, FINE | {"led": 0}, ())
    assert w.reaction is None
    w.answered(1, 0.6, FINE, ("current",))
    assert w.reaction is None, "the alarm before the way back does not count"
    w.answered(1, 0.7, FINE, ("current",))
    assert w.reaction.how == "release"


def test_questions_before_the_motion_are_forgotten_when_it_begins():
    w = watch()
    w.silent(1, 0.1)
    w.begin(1.0)
    assert (w.failed(1), w.heard(1), w.heard(2)) == (0, 1.0, 1.0)


def test_a_stop_carries_its_reaction():
    reaction = Reaction("release", "servo 3: current")
    assert StopError(reaction).reaction is reaction
    assert str(StopError(reaction)) == "servo 3: current"
