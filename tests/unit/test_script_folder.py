"""Which files clients may read and write as scripts: silo's own, in a folder for them, and none that is hidden."""

import functools
from pathlib import Path

import pytest

from silo.files.atomic import check_room
from silo.rpc.refusals import RequestRefusedError
from silo.scripts import script_folder
from silo.scripts.script_folder import check_target, folder_of, is_script, list_scripts, read_text, resolve
from silo.settings.script_conditions import KEYS

SCRIPT = "log_elements:\n  - name: /log/x\n    enabled: true\n"
SECRET = "apiVersion: v1\nkind: Secret\ndata: {password: aGVsbG8=}\n"


@pytest.fixture
def started_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program with no `script=`, started in a folder that holds anything."""
    monkeypatch.setattr(script_folder, "_SHARED", (tmp_path,))
    for name in (".kube/secret.yaml", "compose.yaml", "deploy/secret.yaml", ".config/app.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(SECRET)
    return tmp_path / "logger.yaml"


def use(asked: str, own: Path) -> str:
    """Read as a viewer does, then write as an operator does; the text if both are allowed."""
    path = resolve(asked, own)
    text = read_text(path)
    check_target(path, own, overwrite=True)
    return text


@pytest.mark.parametrize("asked", [".kube/secret.yaml", "compose.yaml", "deploy/secret.yaml", ".config/app.yaml"])
def test_files_of_others_are_neither_read_nor_overwritten_nor_listed(started_in, asked) -> None:
    with pytest.raises(RequestRefusedError):
        use(asked, started_in)
    with pytest.raises(RequestRefusedError):
        use(str(started_in.parent / asked), started_in)
    assert list_scripts(started_in) == []
    assert (started_in.parent / asked).read_text() == SECRET


@pytest.mark.parametrize("asked", [".config/x.yaml", ".x.yaml", "a/.b/c.yaml", "../x.yaml"])
def test_nothing_hidden_and_nothing_outside_is_made(started_in, asked) -> None:
    with pytest.raises(RequestRefusedError):
        resolve(asked, started_in)


def test_a_name_means_the_folder_of_scripts_whatever_else_lies_beside_it(started_in) -> None:
    folder = started_in.parent / "logger.scripts"
    assert resolve("compose.yaml", started_in) == folder / "compose.yaml"
    for asked in (str(started_in.parent / "walk.yaml"), "../walk.yaml", str(started_in.parent / "compose.yaml")):
        name = Path(asked).name
        with pytest.raises(RequestRefusedError, match=f"or below: '{name}' alone means {folder / name}$"):
            resolve(asked, started_in)


@pytest.mark.parametrize("asked", ["circle/x.yaml", "circle.yaml", f"{'ö' * 200}.yaml"])
def test_a_path_that_leads_nowhere_is_refused_in_words(tmp_path, asked) -> None:
    for name in ("circle", "circle.yaml"):
        (tmp_path / name).symlink_to(name)
    own = tmp_path / "robot.yaml"
    assert list_scripts(own) == []
    with pytest.raises(RequestRefusedError, match=r"leads nowhere: .*; nothing was changed"):
        check_target(resolve(asked, own), own, overwrite=True)


def test_new_scripts_go_into_a_folder_of_their_own_where_the_program_has_none(started_in) -> None:
    path = resolve("walk.yaml", started_in)
    assert path == started_in.parent / "logger.scripts" / "walk.yaml"
    check_target(path, started_in, overwrite=False)
    path.write_text(SCRIPT)
    assert list_scripts(started_in) == ["walk.yaml"]
    assert use("walk.yaml", started_in) == SCRIPT


def test_scripts_of_clients_leave_others_room_on_the_disk(tmp_path, monkeypatch) -> None:
    full = functools.partial(check_room, room=lambda _: (19_999_999, 10**9))
    monkeypatch.setattr("silo.scripts.script_folder.check_room", full)
    with pytest.raises(RequestRefusedError, match=r"nearly full: 20 MB are free.*left to others.*nothing was changed"):
        check_target(tmp_path / "new.yaml", tmp_path / "robot.yaml", overwrite=False)


def test_scripts_in_the_old_place_are_read_for_one_release_and_told(started_in, caplog) -> None:
    (started_in.parent / "walk.yaml").write_text(SCRIPT)
    started_in.write_text(SCRIPT)
    assert list_scripts(started_in) == ["logger.yaml", "walk.yaml"]
    for _ in range(2):
        assert read_text(resolve("walk.yaml", started_in)) == SCRIPT
    (told,) = [one.getMessage() for one in caplog.records if "move it there" in one.getMessage()]
    assert told.startswith(f"{started_in.parent / 'walk.yaml'}: scripts of clients stand in ")


def test_a_folder_that_the_program_chose_is_that_of_scripts(tmp_path) -> None:
    own = tmp_path / "config" / "robot.yaml"
    assert folder_of(own) == own.parent
    own.parent.mkdir()
    (own.parent / "secret.yaml").write_text(SECRET)
    (own.parent / "other.yaml").write_text("# nothing yet\n\n")
    assert list_scripts(own) == ["other.yaml"]
    for call in (lambda: read_text(resolve("secret.yaml", own)), lambda: use("secret.yaml", own)):
        with pytest.raises(match="no script of silo"):
            call()


@pytest.mark.parametrize(
    "text", [SCRIPT, '{"log_elements": []}', "\ufeff# mine\nlog_elements: []\n", "", "# nothing\n"]
)
def test_what_is_a_script(text) -> None:
    assert script_folder.is_script(text)


@pytest.mark.parametrize("text", [SECRET, "password: x\n", "a:\n  b: log_elements\n", "- log_elements\n"])
def test_what_is_none(text) -> None:
    assert not script_folder.is_script(text)


@pytest.mark.parametrize("key", ["log_elements", *KEYS])
def test_a_file_with_any_key_of_a_script_is_one(key: str) -> None:
    assert is_script(f"# mine\n{key}: []\n")
    assert not is_script(f"mine: {key}\n")


def test_scripts_of_clients_stand_in_one_place_whichever_default_a_logger_has(started_in) -> None:
    assert folder_of(started_in.with_name("arm.logger.yaml")) == folder_of(started_in)
