"""A recording is read as its columns say, or refused in one line that names file, line, column and mend."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sanguine.domain.blood import ANATOMY
from sanguine.domain.errors import InputError
from sanguine.domain.facs import EMOTIONS
from sanguine.domain.physiology.recording import read_recording

HEADER = "time_s,subject,sex,emotion,spo2_percent,pulse_bpm"


def read(path, **options):
    return read_recording(path, list(EMOTIONS), list(ANATOMY), **options)


def table(tmp_path, *lines):
    path = tmp_path / "r.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def rows(count=4, cells="98,70", start=0.0, step=5.0, subject="s1"):
    return [f"{start + k * step:g},{subject},f,neutral,{cells}" for k in range(count)]


def test_values_are_in_base_units_and_empty_cells_are_missing(tmp_path):
    path = table(
        tmp_path, "# synthetic", "time_ms,subject,sex,emotion,spo2_percent,pulse_hz,perfusion_percent,melanin_index",
        "0,s1,F,neutral,98,1.2,3,412", "", "20000,s1,female,Anger,,1.3,2,413", "0,s2,,sad,97,1.0,1.5,",
    )  # fmt: skip
    recording = read(path)
    assert recording.rows == 3 and len(recording.sha256) == 64
    by = {(track.subject, track.measure.id): track for track in recording.tracks}
    spo2 = by["s1", "spo2"]
    np.testing.assert_array_equal(spo2.time_s, [0.0, 20.0])
    np.testing.assert_array_equal(spo2.value, [0.98, np.nan])
    np.testing.assert_array_equal(spo2.line, [3, 5])
    assert list(spo2.emotion) == ["neutral", "anger"] and spo2.sex == "female" and by["s2", "spo2"].sex == ""
    np.testing.assert_allclose(by["s1", "pulse"].value, [72.0, 78.0])
    np.testing.assert_allclose(by["s1", "perfusion"].value, [0.03, 0.02])
    assert ("s2", "melanin_index") not in by  # not one value


def test_an_analyser_that_visits_regions_beside_one_oximeter(tmp_path):
    path = table(
        tmp_path, "time_s,subject,sex,emotion,region,spo2_percent,hemoglobin_index",
        "0,s1,m,neutral,cheeks,98,1.2", "0,s1,m,neutral,nose,98,1.4", "5,s1,m,neutral,cheeks,97,1.3",
        "6,s1,m,neutral,nose,,1.5", "12,s1,m,neutral,nose,96,1.5",
    )  # fmt: skip
    by = {(track.measure.id, track.region): track for track in read(path).tracks}
    assert set(by) == {("spo2", ""), ("hemoglobin_index", "cheeks"), ("hemoglobin_index", "nose")}
    np.testing.assert_array_equal(by["spo2", ""].time_s, [0, 5, 12])
    np.testing.assert_array_equal(by["hemoglobin_index", "nose"].time_s, [0, 6, 12])


def test_own_labels_and_columns_left_out(tmp_path):
    path = table(tmp_path, HEADER + ",note", "0,s1,f,Joy,98,70,x", "9,s1,f,rest,98,70,y", "12,s1,f,,98,70,y")
    track = read(path, labels={"joy": "happy", "Rest": "neutral"}, ignore=["note"]).tracks[0]
    assert list(track.emotion) == ["happy", "neutral", ""]


FINE = rows()


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], ["empty", "time_s,subject"]),
        ([HEADER], ["line 1", "no samples"]),
        ([HEADER.replace(",", ";"), *FINE], ["line 1", "commas"]),
        ([HEADER.replace("subject,", ""), *FINE], ["line 1", "'subject' is missing"]),
        ([HEADER.replace("emotion", "emotoin"), *FINE], ["'emotoin' is unknown", "did you mean 'emotion'", "--ignore"]),
        ([HEADER.replace("spo2_percent", "spo2"), *FINE], ["'spo2'", "unit", "spo2_percent or spo2_fraction"]),
        ([HEADER.replace("time_s", "time"), *FINE], ["'time'", "unit", "time_s or time_ms"]),
        ([HEADER.replace("pulse_bpm", "spo2_fraction"), *FINE], ["'spo2_percent' and 'spo2_fraction'", "same measure"]),
        ([HEADER.replace("pulse_bpm", "spo2_percent"), *FINE], ["'spo2_percent'", "twice"]),
        (["time_s,subject,sex,emotion", "0,s1,f,neutral"], ["nothing is measured"]),
        ([HEADER, *FINE, "30,s1,f,neutral,98"], ["line 6", "5 cells", "header has 6"]),
        ([HEADER, *FINE, "30,s1,f,neutral,-3,70"], ["line 6: spo2_percent", "-3", "negative", "0 to 100", "empty"]),
        ([HEADER, *FINE, "30,s1,f,neutral,250,70"], ["line 6: spo2_percent", "250", "0 to 100"]),
        ([HEADER, *FINE, "30,s1,f,neutral,NaN,70"], ["line 6: spo2_percent", "'NaN'", "empty"]),
        ([HEADER, *FINE, "30,s1,f,neutral,9_8,70"], ["line 6: spo2_percent", "'9_8'"]),
        ([HEADER, *FINE, "30,s1,f,neutral,--,70"], ["line 6: spo2_percent", "'--' is not a number"]),
        ([HEADER, *FINE, ",s1,f,neutral,98,70"], ["line 6: time_s", "missing"]),
        ([HEADER, *FINE, "30,,f,neutral,98,70"], ["line 6: subject", "missing"]),
        ([HEADER, *FINE, "30,s1,x,neutral,98,70"], ["line 6: sex", "'x'", "female, male"]),
        ([HEADER, *FINE, "30,s1,m,neutral,98,70"], ["line 6: sex", "male", "'s1' is female on line 2"]),
        ([HEADER, *FINE, "30,s1,f,angry,98,70"], ["line 6: emotion", "'angry'", "did you mean 'anger'", "--labels"]),
        ([HEADER, *FINE, "12,s1,f,neutral,98,70"], ["line 6: time_s", "'12'", "line 5", "sort"]),
        ([HEADER, *FINE, "10,s1,f,neutral,98,70"], ["line 6: time_s", "'10'", "line 4 already", "remove"]),
        ([HEADER, *rows(cells="0.98,70")], ["spo2_percent", "0.98", "spo2_fraction"]),
        ([HEADER.replace("percent", "fraction"), *FINE], ["spo2_fraction: 98", "0 to 1", "spo2_percent"]),
        ([HEADER, *rows(cells="98,1.2")], ["pulse_bpm", "1.2", "pulse_hz"]),
        ([HEADER.replace("bpm", "hz"), *FINE], ["pulse_hz", "70", "pulse_bpm"]),
        ([HEADER, *rows(step=20_000)], ["time_s", "17 hours", "time_ms"]),
        ([HEADER.replace("time_s", "time_ms"), *FINE], ["time_ms", "0.015 s", "time_s"]),
        (["time_s,subject,sex,emotion,region,melanin_index", "0,s1,f,neutral,cheek,400"], ["line 2: region", "did you mean 'cheeks'"]),
        ([HEADER, '0,"s1'], ["not valid CSV"]),
        ([HEADER, "0,s\x001,f,neutral,98,70"], ["line 2"]),
        ([HEADER + ",x" * 300], ["306 columns"]),
    ],
    ids=lambda value: None if value and isinstance(value[0], str) and value[0].startswith("line") else str(value)[-40:],
)  # fmt: skip
def test_faults_are_one_line(tmp_path, lines, words):
    path = table(tmp_path, *lines)
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and "\n" not in message and len(message) < 400 + len(str(path))
    for word in words:
        assert word in message


def test_two_readings_of_one_sensor_at_one_time_must_agree(tmp_path):
    header = "time_s,subject,sex,emotion,region,spo2_percent,melanin_index"
    path = table(tmp_path, header, "0,s1,f,neutral,cheeks,98,400", "0,s1,f,neutral,nose,91,400")
    with pytest.raises(InputError, match="line 3: spo2_percent or emotion of 's1' differs from line 2"):
        read(path)


LINES = st.lists(
    st.one_of(
        st.sampled_from(
            [HEADER, "0,s1,f,neutral,98,70", "1e300,s1,f,anger,98,70", "9,s2,m,anger,0,0", "# x", '"', "5,s1,f,,,"]
        ),
        st.text(alphabet='time_sub,0123456789.\n"e-+x \x00\u00e9\u2028;', max_size=40),
    ),
    max_size=8,
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.one_of(LINES.map(lambda lines: "\n".join(lines).encode()), st.binary(max_size=80)))
def test_any_bytes_are_read_or_refused_in_one_line(tmp_path, content):
    path = tmp_path / "any.csv"
    path.write_bytes(content)
    try:
        read(path)
    except InputError as error:
        assert "\n" not in str(error) and str(error).startswith(str(path))
