"""Rules for runs and a run held against a good one: what is found, how it is said, what CI reads of it."""

import itertools
import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.core.conditions import SignalLimits
from silo.core.recording import RecordedEntry
from silo.errors import ScriptError
from silo.guards.guard import guard, words
from silo.guards.rules import Rule, read_rules

TICKS = 50


def write(folder, name, scale=1.0, offset=0.0, slow=True, limits=()):
    clock = itertools.count(1_700_000_000_000_000_000, 10_000_000).__next__
    log = silo.Logger("dog", frequency=100, folder=folder, clock=clock, script=folder / "none.yaml")
    tau = log.array("tau", group="joints", unit="Nm")
    mode = log.array("mode", dtype=np.int32)
    if slow:
        log.array("slow")
    for one in limits:
        log._conditions._set_limits(one)
    log.start()
    for tick in range(TICKS):
        tau[...] = scale * np.sin(tick / 5) + offset
        mode[...] = tick > 10
        log.collect()
    log.save(("silo",), name=name)
    log.close()
    return folder / f"{name}.silo"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    limit = [SignalLimits("joints/tau", bounds=(None, None, None, 1.5))]
    write(root, "good", limits=limit)
    write(root, "same", limits=limit)
    write(root, "worse", scale=2.0, slow=False, limits=limit)
    write(root, "shifted", offset=0.05, limits=limit)
    return root


def found(folder, run, rules="", against=None):
    path = folder / "rules.yaml"
    path.write_text(rules)
    recordings = [silo.open_log(folder / f"{one}.silo").recording for one in (run, against) if one]
    return guard(recordings[0], read_rules(path) if rules else [], recordings[1] if against else None)


@pytest.mark.parametrize(
    ("run", "rule", "verdict", "says"),
    [
        ("good", "- never: joints/tau > 0.9Nm", "VIOLATED", ""),
        ("good", "- always: joints/tau < 1.1", "GREEN", ""),
        ("good", "- holds: max(joints/tau) < 1 and lost == 0", "GREEN", ""),
        ("worse", "- holds: max(joints/tau) < 1", "VIOLATED", "doesn't hold"),
        ("worse", "- {value: max(joints/tau), at_most: 1.5}", "VIOLATED", "it is 1.99"),
        ("worse", "- {value: max(joints/tau), at_least: 1.5}", "GREEN", ""),
        ("worse", "- {value: min(joints/tau), at_least: -0.5}", "VIOLATED", "it is -1.99"),
        ("shifted", "- {value: mean(joints/tau), within: 0.06}", "GREEN", ""),
        ("shifted", "- {value: mean(joints/tau), within: 0.04}", "VIOLATED", "the baseline has"),
        ("shifted", "- {value: rms(joints/tau), within: 10%}", "GREEN", ""),
        ("worse", "- {value: rms(joints/tau), within: 90%}", "VIOLATED", "is allowed"),
        ("worse", "- {value: count(mode), at_least: 50.0000001}", "VIOLATED", "has 50; 50.0000001 to inf is allowed"),
        ("worse", "- {value: rms(joints/tau), at_most: 201%}", "GREEN", ""),
        ("worse", "- {value: rms(joints/tau), at_most: 199%}", "VIOLATED", ""),
        ("worse", "- {value: rms(joints/tau), at_least: 201%}", "VIOLATED", ""),
        ("worse", "- {value: mean(slow), within: 1}", "UNOBSERVABLE", "the run lacks"),
        ("worse", "- holds: mean(slow) < 1", "UNOBSERVABLE", "the run lacks"),
        ("worse", "- signals: slow", "UNOBSERVABLE", "the run does not have it"),
        ("worse", "- {signals: '*', tolerance: 9}", "UNOBSERVABLE", "the run does not have it"),
        ("good", "- {value: max(mode), at_least: 1}", "GREEN", ""),
        ("good", "- {value: max(mode), at_most: 1}", "GREEN", ""),
        ("good", "- {value: max(mode), within: 0}", "GREEN", ""),
        ("shifted", "- {value: min(joints/tau), within: 6%}", "GREEN", ""),
        ("shifted", "- {value: min(joints/tau), within: 4%}", "VIOLATED", "the baseline has -0.99"),
        *(  # of a negative number 90 percent are less, and 110 more
            ("good", f"- {{value: min(joints/tau), {share}}}", verdict, "") for share, verdict in (
                ("at_most: 110%", "GREEN"), ("at_least: 90%", "GREEN"), ("at_most: 90%", "VIOLATED"),
                ("at_least: 110%", "VIOLATED"))
        ),
        ("same", "- signals: joints/*", "GREEN", ""),
        ("shifted", "- {signals: joints/*, tolerance: 0.051}", "GREEN", ""),
        ("shifted", "- {signals: joints/*, tolerance: 0.049}", "VIOLATED", ""),
        ("shifted", "- {signals: joints/*, tolerance: 0.049, event: mode == 1}", "VIOLATED", ""),
        ("shifted", "- {name: same torque, signals: joints/*}", "VIOLATED", ""),
    ],
)  # fmt: skip
def test_a_rule_finds_what_it_says(folder, run, rule, verdict, says):
    first = found(folder, run, rule, "good")[0]
    assert first.worst == verdict
    assert says in first.why
    assert first.violated == (verdict == "VIOLATED")
    assert first.what == "same torque" or "same torque" not in rule


@pytest.mark.parametrize(
    ("unit", "rule", "verdict"),
    [
        ("mNm", "- {value: max(joints/tau), at_most: 110%}", "VIOLATED"),
        ("mNm", "- {value: max(joints/tau), at_most: 110000%}", "GREEN"),
        ("mNm", "- {value: max(joints/tau), within: 0.1}", "VIOLATED"),
        ("mNm", "- {value: 'max(joints/tau) - min(joints/tau)', at_least: 90000%}", "GREEN"),
        ("Nm", "- {value: max(joints/tau), at_most: 101%}", "GREEN"),
        ("-", "- {value: max(joints/tau), at_most: 101%}", "GREEN"),
        ("m", "- {value: max(joints/tau), at_most: 101%}", "UNOBSERVABLE"),
    ],
)
def test_the_baseline_is_taken_in_the_units_of_the_run(folder, unit, rule, verdict):
    run = silo.open_log(folder / "good.silo").recording
    good = replace(run, elements=[replace(one, unit=unit) if one.unit == "Nm" else one for one in run.elements])
    (folder / "rules.yaml").write_text(rule)
    assert guard(run, read_rules(folder / "rules.yaml"), good)[0].worst == verdict


def test_a_run_that_ends_before_the_good_one_is_judged_as_far_as_it_goes_and_that_is_told(folder):
    good = silo.open_log(folder / "good.silo")
    short = good.clip(0, 0.2).recording
    rules = [Rule("signals", "joints/*")]
    same, rest = guard(short, rules, good.recording)[:2]
    assert (same.worst, rest.worst, rest.what) == ("GREEN", "UNOBSERVABLE", "joints/* as the baseline to its end")
    assert "0.2 s" in rest.why
    assert [one.worst for one in guard(good.recording, rules, short)[:1]] == ["GREEN"]
    assert not any("to its end" in one.what for one in guard(good.recording, rules, short))


def test_an_event_of_the_good_run_that_does_not_happen_is_a_difference_and_the_other_rules_are_judged(folder):
    good = silo.open_log(folder / "good.silo")
    short = good.clip(0, 0.1).recording
    rules = [Rule("signals", "joints/*", event="mode == 1"), Rule("holds", "max(joints/tau) < 9")]
    assert [one.worst for one in guard(short, rules, good.recording)[:2]] == ["VIOLATED", "GREEN"]
    first, other = guard(good.recording, rules, short)[:2]
    assert (first.worst, other.worst) == ("UNOBSERVABLE", "GREEN")
    assert "the event 'mode == 1' doesn't happen in the first run" in first.why


@pytest.mark.parametrize(
    ("rule", "verdict"),
    [
        ("- holds: max(joints/tau) < 100", "VIOLATED"),
        ("- holds: mean(joints/tau) < 100", "VIOLATED"),
        ("- {value: max(joints/tau), at_most: 100}", "VIOLATED"),
        ("- {value: min(joints/tau), at_least: -1}", "GREEN"),
        ("- holds: count(joints/tau) == 49", "GREEN"),
    ],
)
def test_a_rule_sees_what_is_infinite_and_no_nan(folder, rule, verdict):
    recording = silo.open_log(folder / "good.silo").recording
    (tau,) = [one for one in recording.elements if one.name == "/log/joints/tau"]
    values = np.array(tau.entries[0].values)
    values[7:9] = np.nan, np.inf
    broken = replace(tau, entries=(RecordedEntry(tau.name, tau.entries[0].entry, values),))
    (folder / "rules.yaml").write_text(rule)
    judged = guard(replace(recording, elements=(broken,)), read_rules(folder / "rules.yaml"), None)
    assert judged[0].worst == verdict


@pytest.mark.parametrize(
    ("run", "rule", "violated"),
    [
        ("same", "", []),
        ("worse", "", ["nothing is missing", "/log/joints/tau"]),
        ("worse", "- new: [limits]", ["/log/joints/tau"]),
        ("worse", "- new: []", []),
        ("worse", "- never: joints/tau > 9", ["nothing is missing", "/log/joints/tau"]),
        ("shifted", "", []),
    ],
)
def test_beside_a_good_run_nothing_may_be_newly_missing_or_broken(folder, run, rule, violated):
    assert [one.what for one in found(folder, run, rule, "good") if one.violated] == violated
    # what the good one broke, too, is nothing new
    assert not [one.what for one in found(folder, run, rule, run) if one.violated]


@pytest.mark.parametrize(
    ("rules", "says"),
    [
        ("- nevr: x", "rules.yaml:1: a rule is one of"), ("x: 1", "a list"), ("", "a list"),
        ("- never: x\n- {never: a, always: b}", "rules.yaml:2: a rule is one of"),
        ("- {never: a, within: 3}", "has no 'within'"),
        ("- value: max(x)", "needs within"), ("- {value: max(x), within: -1}", "from 0 on"),
        ("- {value: max(x), at_most: much}", "at_most is a number"), ("- {signals: x, tolerance: 1%}", "got a share"),
        ("- new: [all]", "list of missing"), ("- never: [a]", "never is a text"), ("- holds:", "holds is empty"),
        ("- a: [", "not valid YAML"), ("- {value: max(nope), at_most: 3}", r"rules.yaml:1: no run has 'nope'"),
        ("- never: nope > 1", r"rules.yaml:1:"), ("- signals: nope*", "rules.yaml:1: the baseline has no"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_rules_is_said_with_file_and_line(folder, rules, says):
    path = folder / "rules.yaml"
    path.write_text(rules)
    good = silo.open_log(folder / "good.silo").recording
    with pytest.raises(ScriptError, match=says):
        guard(good, read_rules(path), good)


@pytest.mark.parametrize("rule", ["within: 1%", "within: 1", "at_most: 110%"])
def test_a_rule_that_needs_a_good_run_says_so(folder, rule):
    with pytest.raises(ScriptError, match=r"rules.yaml:1.*--against"):
        found(folder, "good", f"- {{value: max(joints/tau), {rule}}}")


def test_more_that_is_lost_than_of_the_good_run_is_new_and_no_less(folder):
    good = silo.open_log(folder / "good.silo").recording
    lossy = replace(good, elements=[replace(one, lost=3) for one in good.elements[:2]])
    rules = [Rule("new", parts=("lost",))]
    lost = guard(lossy, rules, good)[0]
    assert (lost.worst, lost.violations, lost.why) == ("VIOLATED", 1, "6 samples lost, 0 of the baseline")
    assert words(lost) == lost.why
    assert [guard(run, rules, lossy)[0].worst for run in (good, lossy)] == ["GREEN", "GREEN"]


def test_what_the_good_run_lacks_is_not_what_the_run_lacks(folder):
    blind = found(folder, "good", "- {value: mean(slow), within: 1}", "worse")[0]
    assert (blind.worst, blind.why) == ("UNOBSERVABLE", "the baseline lacks something that it speaks of")
    assert not [one for one in found(folder, "good", "- new: [missing]", "worse") if one.violated]


def test_a_violation_without_words_is_told_by_how_often_when_first_and_its_peak(folder):
    never = found(folder, "good", "- never: joints/tau > 0.9Nm")[0]
    assert words(never) == "violated 2 times, first at 0.06 s"
    assert words(replace(never, violations=1, first_s=None, peak=None)) == "violated 1 time"
    assert words(replace(never, violations=2, first_s=0.5, peak=1.25, unit="-")) == (
        "violated 2 times, first at 0.5 s, peak 1.25"
    )


def test_the_shell_judges_and_writes_a_report(folder, tmp_path):
    rules = tmp_path / "rules.yaml"
    rules.write_text("- {name: torque, value: max(joints/tau), at_most: 110%}\n- {value: mean(slow), within: 1}\n")

    def ran(run, *arguments):
        run = CliRunner().invoke(
            cli,
            ["check", str(folder / f"{run}.silo"), "--rules", str(rules), *map(str, arguments)],
            standalone_mode=False,
        )
        code = getattr(run.exception, "exit_code", run.return_value)
        return code, str(run.exception or "") + run.stdout + ("" if "--json" in arguments else run.stderr)

    report = tmp_path / "report.xml"
    code, said = ran("worse", "--against", folder / "good.silo", "--junit", report)
    assert code == 4
    assert "torque: it is 1.99" in said
    suite = ElementTree.parse(report).getroot()[0]
    assert {key: suite.get(key) for key in ("tests", "failures", "skipped")} == {
        "tests": "5",
        "failures": "3",
        "skipped": "1",
    }
    assert [case.get("name") for case in suite if case.find("failure") is not None] == [
        "torque", "nothing is missing", "/log/joints/tau"
    ]  # fmt: skip
    code, said = ran("same", "--against", folder / "good.silo", "--json")
    assert code == 0
    assert [one["what"] for one in json.loads(said)][:1] == ["torque"]
    code, said = ran("same")
    assert code == 1
    assert f"{rules}:1: this needs a run" in said


def test_the_fixture_fails_a_test_with_what_is_wrong(folder, silo_runs):
    assert len(silo_runs(folder)) == 4
    silo_runs.check(folder / "same.silo", against=folder / "good.silo")
    with pytest.raises(AssertionError, match="slow") as failed:
        silo_runs.check(folder / "worse.silo", against=folder / "good.silo")
    assert "2 of 3 violated" in str(failed.value)
