"""The gaits of data/gaits, whose rows the docs show: certified, and played as certified."""

import pytest

from studies.gait_row_seeds import Seed, as_csv, keep, median
from studies.gait_rows import BEGIN, END, PAGE, certified, markdown, played, rows
from workbench.files import InputError
from workbench.robot import puppy_model

MODEL = puppy_model()
ROWS = rows(MODEL)


def test_there_are_rows_and_the_docs_show_them():
    assert ROWS
    text = PAGE.read_text(encoding="utf-8")
    assert text[text.index(BEGIN) + len(BEGIN):text.index(END)].strip() == markdown(ROWS)
    assert all(row.certificate.kept for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])
def test_a_row_s_bytes_do_what_its_certificate_says(row):
    said, did = certified(row.certificate), played(row, MODEL, "compiled")
    assert did.speed == pytest.approx(said.speed, rel=0.03)
    assert did.heading == pytest.approx(said.heading, abs=1.0)
    assert did.tilt <= 1.1 * said.tilt
    assert did.torque <= 1.1 * said.torque


def test_the_median_seed_is_kept_and_refused_ones_are_told(tmp_path):
    row = ROWS[0]
    folder = next(path for path in PAGE.parents[1].glob(f"data/gaits/{row.name}"))
    seeds = [Seed(k, folder, row.certificate if k else None, 10.0) for k in range(3)]
    assert median(seeds).seed == 1
    lines = as_csv(seeds).splitlines()
    assert [line.split(",")[1] for line in lines[1:]] == ["no", "yes", "yes"]
    kept = keep("again", seeds, ["--speed", "0.3"], tmp_path)
    assert (kept / "gait.csv").read_bytes() == (folder / "gait.csv").read_bytes()
    assert (kept / "command.txt").read_text() == "workbench optimize --speed 0.3 --seed 1\n"
    with pytest.raises(InputError, match="none of 1 seeds"):
        median(seeds[:1])
