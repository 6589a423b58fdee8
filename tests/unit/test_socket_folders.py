"""In which folders loggers are looked for, which of them are closed, and what `silo ls` clears away there."""

import os
import socket

import pytest

from silo.cli.loggers.ls import _sweep
from silo.net import folders

UID, GID = os.getuid(), os.getgid()


@pytest.fixture
def root(runtime_folder, monkeypatch):
    """Where the folders of all users lie; the private one of this user among them."""
    monkeypatch.delenv("SILO_RUNTIME_DIR")
    monkeypatch.setattr(folders, "shared_memory_root", lambda: runtime_folder)
    monkeypatch.setattr(folders, "runtime_dir", lambda: runtime_folder / f"silo-{UID}")
    folder(runtime_folder / f"silo-{UID}", 0o700)
    return runtime_folder


def folder(path, mode):
    path.mkdir()
    path.chmod(mode)
    return path


def test_a_folder_is_used_where_owner_group_and_mode_are_what_its_name_says(root):
    own, shared = root / f"silo-{UID}", folder(root / f"silo-{UID}-{GID}", 0o750)
    for name, mode in ((f"silo-{UID}-{GID + 1}", 0o750), (f"silo-{UID + 1}-{GID}", 0o750), (f"silo-{UID + 1}", 0o700)):
        folder(root / name, mode)
    (root / f"silo-{UID}-").mkdir()
    assert folders.usable_folders() == folders.own_folders() == [own, shared]
    for mode in (0o770, 0o751):
        shared.chmod(mode)
        assert folders.usable_folders() == [own]


def test_a_folder_that_somebody_else_shares_is_used_and_is_not_our_own(runtime_folder, monkeypatch):
    shared = folder(runtime_folder.with_name(f"{runtime_folder.name}-{GID}"), 0o750)
    assert folders.usable_folders() == folders.own_folders() == [runtime_folder, shared]
    monkeypatch.setattr("os.getuid", lambda: UID + 1)
    monkeypatch.setattr(folders, "runtime_dir", lambda: runtime_folder)
    assert folders.usable_folders() == [runtime_folder, shared]
    assert folders.own_folders() == [runtime_folder]


def test_another_private_folder_of_this_user_is_not_taken_for_one_that_is_shared(runtime_folder):
    """As of two robots that are tried on one computer, each with a runtime folder of its own."""
    for end, mode in ((GID, 0o700), (GID + 1, 0o700), (GID + 2, 0o750)):
        folder(runtime_folder.with_name(f"{runtime_folder.name}-{end}"), mode)
    assert folders.usable_folders() == folders.own_folders() == [runtime_folder]


def test_a_closed_folder_is_told_of_where_a_logger_listens_in_it(root):
    alone = folder(root / f"silo-{UID + 1}", 0o700)
    group = folder(root / f"silo-{UID + 1}-{GID}", 0o700)
    folder(root / f"silo-{UID + 2}", 0o700)
    names = [root / f"silo-{UID}" / "own.7.sock", alone / "bot.7.sock", alone / "bot.8-1.sock", group / "arm.7.sock"]
    sockets = []
    try:
        for name in names:
            sockets.append(socket.socket(socket.AF_UNIX))
            sockets[-1].bind(str(name))
        found = folders.forbidden_folders()
    finally:
        for one in sockets:
            one.close()
    assert [(one.path, one.uid, one.loggers) for one in found] == [
        (str(alone), UID, ("bot",)),
        (str(group), UID, ("arm",)),
    ]
    assert ["join the group" in one.advice for one in found] == [False, True]


def test_ls_removes_sockets_of_the_dead_from_every_folder_of_this_user(runtime_folder):
    shared = folder(runtime_folder.with_name(f"{runtime_folder.name}-{GID}"), 0o750)
    dead = [place / "bot.4194305.sock" for place in (runtime_folder, shared)]
    for path in dead:
        path.touch()
    _sweep()
    assert [path.exists() for path in dead] == [False, False]
