"""OSL read as a graph computes what its text says, for all that the effects are written in."""

import math

import numpy as np
import pytest
from sanguine.domain import film, strain
from sanguine.domain.effects import EFFECTS, ELSEWHERE, Frame, Scene
from sanguine.domain.effects import strain as effect
from sanguine.domain.effects.regions import FACE_REGIONS, region_images
from sanguine.domain.op_graph import Closure, Untranslatable, evaluate
from sanguine.domain.osl_graph import compile_stage
from sanguine.domain.parameters import default_skin
from sanguine.domain.plan import default_strengths, make_plan
from sanguine.domain.shader import assemble

ALL_ON = {name: 1.0 for name in default_strengths()}
MAPS = {"skin_map": {"oil": (0.1, 0.9)}, "residual": {}}


def plan_of(strengths, live=True, maps=None, **skin):
    frames = (Frame("a", {"anger": 1.0, "fear": 1.0}, moves=True),)
    return make_plan(Scene(
        default_skin() | skin, frames, dict.fromkeys(ALL_ON, 0.0) | strengths, FACE_REGIONS, live,
        maps=maps or {}, shape_keys=True, pressure=True, presses=True,
    ))


def stage(plan, name):
    return compile_stage(name, assemble(plan)[name].source, ("Normal",) if name == "surface" else ())


def shader(body, more="", functions=""):
    return f"{functions}\nshader test(float a = 2, color c = 0.5, vector v = 0{more},\n output float out = 0)\n{{\n{body}\n}}"


def out(body, functions="", **inputs):
    return evaluate(compile_stage("test", shader(body, functions=functions)), inputs)["out"]


CASES = {"nothing": ({}, True, {}), **{name: ({name: 1.0}, True, {}) for name in ALL_ON}, "all": (ALL_ON, True, {}),
         "all on maps": (ALL_ON, True, MAPS), "a still": (ALL_ON, False, {}), "a bare still": ({}, False, {})}


@pytest.mark.parametrize("case", CASES)
def test_every_effect_compiles_alone_and_with_all_others(case):
    for name, source in assemble(plan_of(*CASES[case])).items():
        graph = compile_stage(name, source.source, ("Normal",))
        assert {item.name for item in source.inputs} <= {port.name for port in graph.inputs}
        values = evaluate(graph, {}, noise=lambda place: np.sin(place.sum(-1)))
        assert all(np.isfinite(value).all() for value in values.values())


def test_what_a_plan_leaves_out_is_no_operation():
    few, many = (len(stage(plan_of(strengths), "chromophores").ops()) for strengths in ({}, ALL_ON))
    assert few < 0.5 * many
    kinds = {op.kind for op in stage(plan_of({}, live=False, oil=0.0), "chromophores").ops()}
    assert kinds <= {"const", "input", "pack", "add", "mul", "max", "sub", "x", "y", "z", "clamp", "log", "div", "dot"}, "no noise, no map"


def test_blood_of_strain_is_the_formula_of_the_domain():
    """rest_mm far to the left: that half's components alone."""
    graph = stage(plan_of({"strain": 1.0}), "chromophores")
    rng = np.random.default_rng(1)
    components = rng.uniform(-0.4, 0.4, (strain.COMPONENTS, 50))
    driven = rng.uniform(0.0, 1.0, (strain.COMPONENTS, 50))
    inputs = {"rest_mm": np.array([100.0, 0.0, 0.0]), "skin_hemoglobin": 0.02, "strain": 1.0}
    for i, image in enumerate(effect.IMAGES):
        inputs[image], inputs[f"{image}_alpha"] = components[4 * i : 4 * i + 3].T, components[4 * i + 3]
    for name, rows in effect.packed_components(effect.IMAGES).items():
        inputs[f"{name}_left"] = np.stack([*driven[list(rows)], *np.full((3 - len(rows), 50), 7.0)], axis=-1)
    found = evaluate(graph, inputs)["chromophores"][..., 0]
    expected = 0.02 * np.exp(strain.blood_change((components * driven).sum(0)))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_blood_is_the_sum_over_regions_of_mask_and_number():
    """Of all regions and of what is in none, as the object's properties hold them three by three."""
    changes = {(region, "hemoglobin"): (-0.01, 0.01) for region in (*FACE_REGIONS[:2], *FACE_REGIONS[4:], ELSEWHERE)}
    plan = make_plan(Scene(default_skin(), (Frame("a", changes=changes),), default_strengths() | {"anatomy": 0.0}, FACE_REGIONS))
    rng = np.random.default_rng(3)
    masks = rng.dirichlet(np.ones(len(FACE_REGIONS) + 1), 40)[:, :-1]
    value = {f"blood_hemoglobin_{region}": rng.uniform(-0.01, 0.01) for region, _ in changes}
    assert {part for parts in plan.packed.values() for part in parts if part} == set(value)
    inputs = {"skin_hemoglobin": 0.02}
    for name, parts in plan.packed.items():
        inputs[name] = np.array([value.get(part, 0.0) for part in parts])
    for image, held in region_images(FACE_REGIONS).items():
        shown = masks[:, [FACE_REGIONS.index(region) for region in held]]
        inputs[image] = np.pad(shown, ((0, 0), (0, 3 - len(held))))
    found = evaluate(stage(plan, "chromophores"), inputs)["chromophores"][..., 0]
    expected = 0.02 + (1.0 - masks.sum(1)) * value["blood_hemoglobin_elsewhere"]
    for i, region in enumerate(FACE_REGIONS):
        expected = expected + masks[:, i] * value.get(f"blood_hemoglobin_{region}", 0.0)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_what_is_in_no_region_shares_one_property():
    """Elsewhere of both quantities and the pressure; nothing of the regions, none of which moves."""
    changes = {(ELSEWHERE, "hemoglobin"): (0.0, 0.01), (ELSEWHERE, "oxygenation"): (-0.1, 0.0)}
    plan = make_plan(Scene(
        default_skin(), (Frame("a", changes=changes),), default_strengths() | {"pressure": 1.0}, FACE_REGIONS, pressure=True, presses=True,
    ))
    assert plan.packed == {"blood_packed_others_0": ("blood_hemoglobin_elsewhere", "blood_oxygenation_elsewhere", "pressure")}
    source = assemble(plan)["chromophores"].source
    assert source.count("color blood_packed_others_0 = ") == 1 and "#define PRESSING blood_packed_others_0[2]\n" in source


def test_place_in_the_table_is_where_the_axis_has_that_value():
    plan = plan_of({})
    graph, axes = stage(plan, "chromophores"), {axis.id: axis for axis in plan.axes}
    hemoglobin, melanin = axes["hemoglobin"], axes["melanin"]
    place = evaluate(graph, {"skin_hemoglobin": hemoglobin.values()[3], "skin_melanin": melanin.values()[5]})
    where = next(value for name, value in place.items() if name.startswith("table_"))
    width = float(next(line.split()[2] for line in assemble(plan)["chromophores"].source.splitlines() if "TABLE_WIDTH" in line))
    # Of every layout the fastest axis is hemoglobin, and a tile begins at the first column.
    assert where[0] * width == pytest.approx(3.5, abs=1e-6)


def test_film_is_read_from_its_table():
    """The reflected share that the lobes lose; what the graph adds up is the closures' weights."""
    graph = stage(plan_of({}), "surface")
    closure = graph.results["BSDF"]
    assert isinstance(closure, Closure)
    assert sorted(leaf.kind for _, leaf in closure.terms) == ["bssrdf"] * (len(closure.terms) - 1) + ["dielectric_bsdf"]
    source = assemble(plan_of({}))["surface"].source.replace("BSDF = film * dielectric_bsdf", "looked = reflected; BSDF = film * dielectric_bsdf")
    source = source.replace("output closure color BSDF = 0", "output float looked = 0, output closure color BSDF = 0")
    source = source.replace("fabs(dot(I, Normal))", "cosine").replace("float film = 0.0", "float cosine = 0.0, float film = 0.0")
    cosines, roughness = np.linspace(0.1, 1.0, 7), 0.35
    import sanguine_core

    found = evaluate(compile_stage("surface", source), {"cosine": cosines, "roughness": np.full(7, roughness)})["looked"]
    expected = [film.film_albedo(cosine, roughness, sanguine_core.OIL_FILM_INDEX) for cosine in cosines]
    np.testing.assert_allclose(found, expected, atol=0.002)  # as `film.ENTRIES` promises


@pytest.mark.parametrize(("body", "expected"), [
    ("out = a > 1 ? a * 3 : -a;", 6.0),
    ("if (a > 1) out = 5; else out = 7;", 5.0),
    ("if (a > 3) { out = 5; } else if (a > 1.5) { out = 6; }", 6.0),
    ("for (int i = 0; i < 4; i++) out += a * i;", 12.0),
    ("int i = 0; while (i < 3) { out += 1; i++; }", 3.0),
    ("out = 7 / 2;", 3.0),
    ("out = 7 / 2.0;", 3.5),
    ("out = int(-a * 0.8);", -1.0),
    ("out = (int) 3.7 + 7 % 4;", 6.0),
    ("out = a / 0;", 0.0),
    ("float t[3] = { 1, 2, 4 }; out = t[int(a)] + t[0];", 5.0),
    ("color d = color(1, 2, 3) * a; d[1] = 10; out = d[0] + d[1] + d[2];", 18.0),
    ("vector d = vector(1, 2, 3); d *= vector(a, 1, 0); out = dot(d, vector(1));", 4.0),
    ("out = length(normalize(vector(a, 3, 5)));", 1.0),
    ("out = mix(10, 20, 0.25) + mix(color(1), color(3), 0.5)[2];", 14.5),
    ("out = smoothstep(1, 3, a) + clamp(a, 3, 4) + max(a, 3) + min(a, 3);", 8.5),
    ("out = exp(log(a)) + pow(a, 3) + sqrt(a * 2) + fabs(-a) + floor(2.7);", 16.0),
    ("out = (a > 1 && a < 1.5) + (a > 1 || a < 1.5) + !a + (a == 2) + (a != 2) + (a >= 2) + (a <= 1);", 3.0),
    ("float b = a; { float b = 100; b += 1; } out = b;", 2.0),
    ("#define TWICE(x) (x##x)\nfloat aa = 3;\n#if 1 + 1 > 1\nout = TWICE(a);\n#else\nout = 0;\n#endif", 3.0),
    ("out = M_PI - 1e0f;", math.pi - 1.0),
])
def test_the_language(body, expected):
    assert out(body) == pytest.approx(expected)


def test_functions_are_inlined_with_their_own_names():
    functions = "float f(float x, float a)\n{\n    float y = x * a;\n    return y + 1;\n}"
    assert out("out = f(a, 10) + f(1, a) + a;", functions) == pytest.approx(21.0 + 3.0 + 2.0)


def test_branches_that_a_value_decides_are_the_right_one_everywhere():
    a = np.array([-1.0, 0.0, 0.5, 2.0])
    found = out("float b = 1; if (a > 0.2) { b = a; out = b * b; } else out = -b;", a=a)
    np.testing.assert_allclose(found, np.where(a > 0.2, a * a, -1.0))


def test_equal_operations_are_one_and_constants_are_folded():
    graph = compile_stage("test", shader("float b = exp(a * 3); float d = exp(3 * a); out = b + d + (2 + 3) * 4 - 20;"))
    assert [op.kind for op in graph.ops()].count("exp") == 1
    assert {op.value for op in graph.ops() if op.kind == "const"} == {3.0}


def test_closures_are_sums_of_weighted_lobes():
    text = """shader s(color w = 0.5, float f = 0.25, output closure color BSDF = 0)
    { closure color body = w * bssrdf("burley", N, vector(1), color(1.0)); body += body; BSDF = (1.0 - f) * body; }"""
    closure = compile_stage("s", text).results["BSDF"]
    assert len(closure.terms) == 2
    weight, leaf = closure.terms[0]
    assert weight.kind == "scale" and leaf.kind == "bssrdf" and leaf.value == ("burley",) and closure.terms[1][1] is leaf


@pytest.mark.parametrize(("body", "line", "what"), [
    ("float b = 1;\nout = cellnoise(b);", 6, "cellnoise"),
    ("out = b;", 5, "'b'"),
    ("while (a > 0) out += 1;", 5, "a loop whose end is not known"),
    ("out = v[int(a)];", 5, "a component that is not known"),
    ("out = v;", 5, "no float"),
    ("string s = \"x\";\nout = s + s;", 6, "'+'"),
    ("out = texture(\"a.exr\", a, a);", 5, "texture"),
    ("out = 1 @ 2;", 5, "plain nodes have nothing"),
    ("matrix m = 1;", 5, "plain nodes have nothing"),
    ("out = BSDF;", 5, "'BSDF'"),
])
def test_what_is_beyond_it_is_one_line_with_its_place(body, line, what):
    with pytest.raises(Untranslatable) as error:
        compile_stage("surface", shader(body))
    text = str(error.value)
    assert text.startswith(f"surface: line {line}: ") and what in text and "\n" not in text


def test_every_effect_of_the_list_was_asked_for():
    active = {effect.id for effect in plan_of(ALL_ON, maps=MAPS).active}
    assert active == {effect.id for effect in EFFECTS}
