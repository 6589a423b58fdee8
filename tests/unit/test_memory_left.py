"""How much memory buffers may take: what the machine has, or less where a control group has a limit."""

from pathlib import Path

import pytest

from silo.core.runtime import _left_to_groups

GB = 1 << 30


def group(folder: Path, limit: str, used: int, files: int, *, first: bool = False) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    names = ("memory.limit_in_bytes", "memory.usage_in_bytes") if first else ("memory.max", "memory.current")
    half, total = files // 2, "total_" if first else ""
    statistics = f"anon 5\n{total}inactive_file {half}\n{total}active_file {files - half}"
    for name, text in zip((*names, "memory.stat"), (limit, used, statistics), strict=True):
        (folder / name).write_text(f"{text}\n")


@pytest.mark.parametrize(
    ("of_process", "left"),
    [
        ("0::/robots/arm\n", [4 * GB - 1 * GB, 8 * GB - 6 * GB]),
        ("0::/robots\n", [8 * GB - 6 * GB]),
        ("0::/\n", []),
        ("0::/../other\n", []),
        ("4:cpu,memory:/arm\n3:cpuset:/\n0::/\n", [GB]),
        ("4:cpu:/arm\n", []),
        ("", []),
    ],
)
def test_of_all_control_groups_above_a_process_each_limit_is_looked_at(tmp_path, of_process, left):
    (tmp_path / "cgroup").write_text(of_process)
    mounted = tmp_path / "mounted"
    group(mounted / "robots", str(8 * GB), 7 * GB, GB)
    group(mounted / "robots" / "arm", str(4 * GB), 3 * GB, 2 * GB)
    group(mounted / "robots" / "free", "max", GB, 0)
    group(mounted / "memory" / "arm", str(2 * GB), 2 * GB, GB, first=True)
    assert _left_to_groups(tmp_path, mounted) == left


def test_a_group_that_has_more_than_it_may_leaves_nothing(tmp_path):
    (tmp_path / "cgroup").write_text("0::/\n")
    group(tmp_path / "mounted", str(GB), 2 * GB, 0)
    assert _left_to_groups(tmp_path, tmp_path / "mounted") == [0]
    assert _left_to_groups(tmp_path / "none", tmp_path / "mounted") == []


def test_of_a_group_without_a_limit_nothing_more_is_read(tmp_path):
    (tmp_path / "cgroup").write_text("4:memory:/\n0::/\n")
    for folder, none in ((tmp_path / "mounted", "max"), (tmp_path / "mounted" / "memory", str(2**63 - 4096))):
        group(folder, none, 0, 0, first=none != "max")
        (folder / "memory.stat").write_text("no numbers")
    assert _left_to_groups(tmp_path, tmp_path / "mounted") == []
