"""What `silo host` reads of this computer."""

import math
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from silo.logger.logger import Logger
from silo.programs.host.probes import PROBES, _pressure
from silo.programs.host.program import Monitor
from silo.programs.host.reading import Probe, Rates, plain_name, reader
from silo.settings.script import apply_script, read_script

CONFIG = Path(__file__).resolve().parents[2] / "config"


@pytest.fixture
def log(tmp_path: Path) -> Logger:
    return Logger("host", frequency=20, max_time=0, folder=tmp_path, script=tmp_path / "host.yaml")


def probe(group: str) -> Probe:
    return next(one for one in PROBES if one.group == group)


def newest(log: Logger, name: str) -> float:
    (value,) = (element for element in log.snapshot().elements if element.name == name)
    return float(value.entries[0].values[-1])


def test_counters_become_rates() -> None:
    now = iter((10.0, 12.0))
    rates = Rates(2, lambda: next(now))
    assert np.isnan(rates.update((100, 5))).all()
    assert rates.update((300, 5)).tolist() == [100.0, 0.0]


def test_a_counter_that_went_back_has_no_rate() -> None:
    now = iter((0.0, 1.0))
    rates = Rates(1, lambda: next(now))
    rates.update((100,))
    assert math.isnan(rates.update((7,))[0])


@pytest.mark.parametrize(
    ("text", "name"), [("Core 0", "Core_0"), ("nvme0n1", "nvme0n1"), ("a/b", "a_b"), ("  ", "unnamed")]
)
def test_names_of_devices_become_names_of_elements(text: str, name: str) -> None:
    assert plain_name(text) == name


def test_every_machine_has_processor_memory_load_and_processes(log: Logger) -> None:
    monitor = Monitor(log)
    log.start()
    for _ in range(21):
        monitor.read()
        log.collect()
    assert 0 < newest(log, "/log/memory/percent") < 100
    assert newest(log, "/log/load_average/1min") == pytest.approx(os.getloadavg()[0], abs=5)
    assert newest(log, "/log/process/count") >= 1
    assert newest(log, "/log/process/self/memory") > 1
    assert newest(log, "/log/kernel/uptime") > 1
    assert any(element.name == "/log/cpu/core00/load" for element in log.elements)
    log.close()


def test_ten_minutes_are_kept_of_every_element(log: Logger) -> None:
    Monitor(log)
    log.update()
    assert {element.options.size * element.options.divider for element in log.elements} == {12_000}
    log.close()


def test_what_the_machine_lacks_is_left_out(log: Logger, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(psutil, "sensors_temperatures", dict, raising=False)
    monkeypatch.delattr(psutil, "sensors_fans", raising=False)
    monkeypatch.setattr(psutil, "sensors_battery", lambda: None, raising=False)
    assert [reader(probe(group), log) for group in ("temperature", "fan", "battery")] == [None] * 3
    log.close()


def test_a_pressure_that_can_not_be_read_hides_no_other(log: Logger, monkeypatch: pytest.MonkeyPatch) -> None:
    def told(path: Path) -> str:
        if path.name == "cpu":
            raise PermissionError
        return f"some avg10={len(path.name)}.50 avg60=0.00\nfull avg10=9.00"

    monkeypatch.setattr(Path, "read_text", told)
    assert _pressure(log) == {"memory": 6.5, "io": 2.5}
    log.close()


def test_sensors_of_the_same_name_are_told_apart(log: Logger, monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = SimpleNamespace(label="Composite", current=40.0)
    monkeypatch.setattr(psutil, "sensors_temperatures", lambda: {"nvme": [sensor, sensor]}, raising=False)
    reader(probe("temperature"), log)
    log.update()
    assert [element.name for element in log.elements] == [
        "/log/temperature/nvme/Composite",
        "/log/temperature/nvme/Composite_2",
    ]
    log.close()


def test_an_interface_that_goes_away_becomes_nan(log: Logger, monkeypatch: pytest.MonkeyPatch) -> None:
    counters = {"eth0": psutil.net_io_counters()}
    monkeypatch.setattr(psutil, "net_io_counters", lambda **_: counters)
    read = reader(probe("network")._replace(divider=1), log)
    assert read is not None
    log.start()
    read()
    log.collect()
    first = newest(log, "/log/network/eth0/received_total")
    counters.clear()
    read()
    log.collect()
    assert first >= 0
    assert math.isnan(newest(log, "/log/network/eth0/received_total"))
    log.close()


def test_the_script_to_copy_fits_elements_that_every_host_has(log: Logger) -> None:
    Monitor(log)
    log.update()
    plan = apply_script(read_script(CONFIG / "host.yaml"), log.elements, log.options.frequency_hz)
    log.close()
    assert plan.unknown == ()
