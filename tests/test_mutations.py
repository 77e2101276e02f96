"""The list of small faults is of the sources that there are."""

from tests.mutations import FAULTS, ROOT


def test_every_fault_is_a_text_of_its_file_and_has_its_tests() -> None:
    for fault in FAULTS:
        text = (ROOT / fault.file).read_text(encoding="utf-8")
        assert text.count(fault.old) == 1, (fault.file, fault.old)
        files = [word for word in fault.tests.split() if word.startswith("tests/")]
        assert [f for f in files if not (ROOT / f).is_file()] == []
