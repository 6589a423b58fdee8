"""Whatever a table holds, its script reads back; whatever a file holds, reading it ends in a script or in words."""

from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import MAX_BUFFER_SIZE, MAX_DIVIDER, Action, BufferType, ElementInfo, ElementOptions, Entry
from silo.errors import ScriptError
from silo.settings.script import apply_script, format_script, parse_script

options = st.builds(
    ElementOptions,
    st.booleans(),
    st.integers(1, MAX_DIVIDER),
    st.sampled_from(Action),
    st.sampled_from(BufferType),
    st.integers(1, MAX_BUFFER_SIZE),
)
names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1)
yaml_like = st.lists(
    st.sampled_from(
        ["log_elements", ":", "- ", "name", "/a", "\n", "  ", *"{}[]|#%?~0\t", "&a", "*a", "!!x", "'", '"', "divider"]
    )
).map("".join)  # fmt: skip


@given(st.dictionaries(names, options, max_size=5))
def test_every_table_survives_its_script(table: dict[str, ElementOptions]) -> None:
    infos = [ElementInfo(name, "-", "scalar", (), (Entry("", "<f8"),), option) for name, option in table.items()]
    script = parse_script(format_script(infos), "s.yaml")
    table_before = [ElementInfo(i.name, "-", "scalar", (), i.entries, ElementOptions()) for i in infos]
    plan = apply_script(script, table_before, 100.0)
    assert (plan.options, plan.unknown) == (tuple(table.values()), ())


@given(st.one_of(st.text(), yaml_like, yaml_like.map("log_elements:\n- name: /a\n  ".__add__)))
def test_every_text_is_a_script_or_an_error_with_a_line(text: str) -> None:
    try:
        script = parse_script(text, "s.yaml")
    except ScriptError as error:
        for line in str(error).splitlines():
            head, number, _ = line.split(":", 2)
            assert head == "s.yaml"
            assert 1 <= int(number) <= max(1, len(text.splitlines()))
    else:
        assert all(element.name for element in script.elements)
