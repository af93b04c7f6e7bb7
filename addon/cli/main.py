"""`sanguine VERB …`: the same verbs in a shell (`.venv/bin/sanguine`) and as `blender --command sanguine VERB …`.

Exit status: 0 when all that was asked was done, 2 for bad input (one line), 1 for any other failure.
Results go to `--out` or, without it, to standard output; progress and messages go to standard error.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from ..domain.errors import InputError
from ..domain.shading import Renderer


def main(arguments: Sequence[str] | None = None) -> int:
    parser = _parser()
    try:
        options = parser.parse_args(arguments)
        return options.run(options)
    except InputError as error:
        print(f"sanguine: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("sanguine: interrupted", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader of our output went away (`| head`); what it wanted it has.
        sys.stderr.close()
        return 1


class _Parser(argparse.ArgumentParser):
    """A wrong flag is bad input like any other: one line, without the usage."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="sanguine", description="Physiologically based skin for Blender.")
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")

    skin = _verb(verbs, "skin", _skin, "what colour is this skin, and how far does light spread in it")
    skin.add_argument("skins", metavar="SKIN.json")
    skin.add_argument("--wavelengths", default="380:780:10", metavar="FIRST:LAST:STEP",
                      help="nm, a range or a list with commas (default %(default)s)")
    skin.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    blood = _verb(verbs, "blood", _blood, "what emotions and states of the body do to the blood and the colour of a skin")
    whose = blood.add_mutually_exclusive_group()
    whose.add_argument("--tone", metavar="LABEL", help="a person of this tone: fitzpatrick-2, monk-9, ita:35, … "
                       "(without it a light, a tan, a brown and a dark skin)")
    whose.add_argument("--skin", metavar="SKIN.json", help="skins, as of the verb skin")
    blood.add_argument("--blood", type=_number, default=1.0, metavar="X",
                       help="the slider: 1 as in life, above that exaggerated, at most 2 (default %(default)s)")
    blood.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    solve = _verb(verbs, "solve", _solve, "what becomes of light in stacks of layers, by a solver of your choice")
    solve.add_argument("cases", metavar="CASES.json")
    solve.add_argument("--solver", default="auto", metavar="NAME",
                       help="auto, skin, multipole, adding-doubling or monte-carlo (default %(default)s)")
    solve.add_argument("--tolerance", type=_share, default=0.01, metavar="X",
                       help="relative error that is good enough, of profiles twice that (default %(default)s)")
    solve.add_argument("--radii", metavar="MM,…", help="where the profile is wanted, for cases that do not say; "
                       "'none' for totals alone (default 40 radii from 0.011 to 18.2 mm)")
    solve.add_argument("--max-seconds", type=_positive, default=60.0, metavar="S",
                       help="per case; a solver that stops early says so (default %(default)s)")
    solve.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    fit = _verb(verbs, "fit", _fit, "what is in a skin: parameters and their standard errors from measured reflectance")
    fit.add_argument("spectra", metavar="SPECTRA.csv", help="a header id,380,390,… (nm), then reflectance 0 to 1")
    fit.add_argument("--specular", default="auto", choices=("auto", "included", "excluded"),
                     help="whether the surface's reflection is in the spectra (SCI) or not (SCE, `sanguine skin`); auto: "
                          "included, unless the model explains them perfectly without (default %(default)s)")
    fit.add_argument("--free", default="", metavar="ID,…",
                     help="let these go where the data lead, for example melanin_blend or bilirubin_umol_per_l")
    fit.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    names = _verb(verbs, "names", _names, "what the shape keys of a rig are: ARKit, FACS, VRM, MetaHuman, MPEG-4 and others")
    names.add_argument("rig", metavar="FILE", help=".gltf, .glb, .vrm, or a text file with a key's name on each line")
    names.add_argument("--own", action="append", default=[], metavar="NAMES.toml",
                       help="names of your own (docs/names.md), tried before those that come with Sanguine; may be repeated")
    names.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    capture = _verb(verbs, "capture", _capture, "a recorded face (Live Link Face, OpenFace, MediaPipe) as curves on the controls")
    capture.add_argument("recording", metavar="FILE.csv")
    capture.add_argument("--fps", type=_positive, default=24.0, metavar="X",
                         help="frames per second of the scene (default %(default)s)")
    capture.add_argument("--smooth", type=_seconds, default=0.0, metavar="S",
                         help="window of the smoothing in seconds, 0.1 takes a tracker's noise; no delay (default none)")
    capture.add_argument("--emotions", default="on", metavar="on|off|NAME,…",
                         help="infer these from the action units, for the blood; on: anger, happy, sad, fear (default %(default)s)")
    capture.add_argument("--head", default="on", choices=("on", "off"),
                         help="the turns of the head as units 51 to 56 (default %(default)s)")
    capture.add_argument("--source-fps", type=_positive, metavar="X",
                         help="the recording's rate, where the file does not tell the time")
    capture.add_argument("--reduce", type=_share, default=0.0, metavar="X",
                         help="leave out keys as long as no value is off by more than X (default: a key on every frame)")
    capture.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    invert = _verb(verbs, "invert", _invert, "melanin, hemoglobin and oxygenation maps from a colour map")
    invert.add_argument("albedo", metavar="ALBEDO", help="a picture; face.1001.png or 'face.<UDIM>.png' is the whole set")
    invert.add_argument("--out-dir", required=True, metavar="DIR",
                        help="folder for chromophores.exr, error.exr, mask.exr, shading.exr and residual.exr")
    invert.add_argument("--skin", metavar="SKIN.json", help="one skin, whose other parameters hold for the whole picture")
    invert.add_argument("--space", default="auto", choices=("auto", "srgb", "linear", "rec709", "rec2020", "acescg"),
                        help="auto: integers are sRGB-encoded, floats linear; all but srgb are linear (default %(default)s)")
    invert.add_argument("--shading", default="auto", choices=("off", "auto", "on"),
                        help="split off light that is baked into the map; auto: as far as it is more than pigment can "
                             "explain (default %(default)s)")
    invert.add_argument("--noise", default="auto", metavar="auto|X",
                        help="standard deviation of the picture's noise in L*a*b* (default %(default)s)")
    invert.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    maps = _verb(verbs, "maps", _maps, "grow what is in the skin of a face, place by place, into chromophore maps")
    maps.add_argument("face", metavar="FACE", help="a head of ours (female, male), a mesh file (.obj .ply .usd .glb .blend), "
                      "or a SHOT.toml, which says the rest too")
    maps.add_argument("--out-dir", required=True, metavar="DIR", help="folder for chromophores.exr")
    maps.add_argument("--object", metavar="NAME", help="which mesh of the file (default: the one with the most faces)")
    maps.add_argument("--unit", default="m", choices=("m", "dm", "cm", "mm", "in"),
                      help="of lengths in the mesh file (default %(default)s)")
    maps.add_argument("--features", default="", metavar="ID=X,…",
                      help="strengths 0 to 1 of features; ID alone is 1, 'all' every one, 'list' prints them")
    maps.add_argument("--tone", metavar="LABEL", help="monk-1 to monk-10, fitzpatrick-1 to -6, or ita:<degrees>: gives the skin "
                      "and the features of such a person, which --features and --skin override")
    maps.add_argument("--sex", default="female", choices=("female", "male"))
    maps.add_argument("--age", type=float, default=30.0, metavar="YEARS")
    maps.add_argument("--sun", type=float, default=0.5, metavar="X", help="exposure of a life, 0 to 1 (default %(default)s)")
    maps.add_argument("--seed", type=int, default=0, metavar="N", help="which individual")
    maps.add_argument("--skin", metavar="SKIN.json", help="its first skin instead of the tone's")
    maps.add_argument("--size", type=int, default=2048, metavar="N", help="texels along a side (default %(default)s)")
    maps.add_argument("--spectral", nargs="?", const="400:700:10", metavar="FIRST:LAST:STEP",
                      help="write the reflectance as a spectral EXR too (default 400:700:10 nm)")
    maps.add_argument("--tx", action="store_true", help="write tiled, mip-mapped copies too")
    maps.add_argument("--cache", metavar="DIR", help="folder of what was computed before, 'none' for none")
    maps.add_argument("--out", metavar="FILE", help="write the report there instead of to standard output")

    physiology = _verb(verbs, "physiology", _physiology, "what recordings of an oximeter and a skin analyser say about the "
                       "blood of emotions")
    physiology.add_argument("recordings", metavar="RECORDING.csv", nargs="+",
                            help="columns time_s, subject, sex, emotion, spo2_percent, pulse_bpm, … (docs/physiology.md)")
    physiology.add_argument("--plots", metavar="DIR", help="folder for changes.png, courses.png and correlations.png")
    physiology.add_argument("--profile", metavar="PROFILE.toml", help="write the supported changes for a rig")
    physiology.add_argument("--sex", default="pooled", choices=("pooled", "female", "male"),
                            help="whose changes the profile holds (default %(default)s)")
    physiology.add_argument("--region", default="", metavar="ID,…",
                            help="where the skin analyser sat, if the recording has no column 'region'")
    physiology.add_argument("--oximeter", default="finger", metavar="SITE",
                            help="finger, or the region of the face it sat on, whose blood its perfusion index then tells")
    physiology.add_argument("--index", default="linear", choices=("linear", "erythema"),
                            help="what the hemoglobin index is: linear in blood, or a logarithm of red over green, which "
                                 "Sanguine's optics turn into blood (default %(default)s)")
    physiology.add_argument("--gain", type=_gain, default=1.0, metavar="X",
                            help="relative change of blood per relative change of a linear index (default %(default)s: a guess)")
    physiology.add_argument("--melanin", type=_melanin, default=0.018, metavar="X",
                            help="of the subjects, for --index erythema (default %(default)s: light skin)")
    physiology.add_argument("--labels", default="", metavar="OWN=EMOTION,…", help="the recording's own words for emotions")
    physiology.add_argument("--ignore", default="", metavar="COLUMN,…", help="columns to leave out")
    physiology.add_argument("--lag-s", default="auto", metavar="auto|X",
                            help="how late the oximeter answers (default: estimated)")
    physiology.add_argument("--settle-s", type=_seconds, default=15.0, metavar="X",
                            help="left out after a label begins (default %(default)s)")
    physiology.add_argument("--recover-s", type=_seconds, default=60.0, metavar="X",
                            help="left out of a neutral label that follows an emotion (default %(default)s)")
    physiology.add_argument("--window-s", type=_positive, default=5.0, metavar="X",
                            help="samples are averaged in windows of this length (default %(default)s)")
    physiology.add_argument("--out", metavar="FILE", help="write the report there instead of to standard output")

    bench = _verb(verbs, "bench", _bench, "measure what accuracy costs in time; for a checkout of the sources")
    bench.add_argument("what", choices=["accuracy"], help="accuracy: every solver and setting of the optics")
    bench.add_argument("--quick", action="store_true", help="a few cases, seconds instead of minutes")
    bench.add_argument("--out", metavar="DIR", help="folder for accuracy.json and accuracy.md (default bench/results)")

    plan = _verb(verbs, "plan", _plan, "what a shot will simulate, and why, without doing it")
    plan.add_argument("shot", metavar="SHOT.toml")
    _quality_flags(plan)
    plan.add_argument("--out", metavar="FILE", help="write the JSON there instead of to standard output")

    bake = _verb(verbs, "bake", _bake, "bake the blood of a .blend anew, so that a farm renders none that is stale")
    bake.add_argument("scene", metavar="SCENE.blend")
    bake.add_argument("--save", metavar="FILE.blend", help="write the baked file there (default: over SCENE.blend)")
    bake.add_argument("--check", action="store_true", help="only say which blood is stale; exit status 1 if any is")
    bake.add_argument("--scene", dest="name", default="", metavar="NAME", help="which scene of the file (default: the active one)")
    bake.add_argument("--out", metavar="FILE", help="write the report there instead of to standard output")

    render = _verb(verbs, "render", _render, "render a shot: one image per subject, expression and frame")
    render.add_argument("shot", metavar="SHOT.toml|SCENE.blend",
                        help="a .blend renders its scene's frames as it is set, its blood baked anew")
    render.add_argument("--out", required=True, metavar="DIR", help="folder for the images and manifest.json")
    _quality_flags(render)
    render.add_argument("--only", metavar="ID,…", help="only these images")
    render.add_argument("--resume", action="store_true", help="keep what an earlier run of the same shot finished")
    render.add_argument("--blend", action="store_true",
                        help="keep the scene of each subject as <subject>.blend, which needs nothing of ours")
    return parser


def _quality_flags(verb: argparse.ArgumentParser) -> None:
    flags = verb.add_mutually_exclusive_group()
    flags.add_argument("--quality", metavar="NAME",
                       help="draft, preview, final or reference, in place of the shot's quality and samples")
    flags.add_argument("--delta-e", type=float, metavar="X",
                       help="the cheapest measured setting whose error is at most X (Delta E 2000)")


def _verb(verbs: Any, name: str, run: Any, help: str) -> argparse.ArgumentParser:
    verb = verbs.add_parser(name, help=help, description=help[0].upper() + help[1:] + ".")
    verb.add_argument("--json-progress", action="store_true",
                      help="progress as one JSON object per line on standard error, for farms")
    verb.set_defaults(run=run)
    return verb


class _Version(argparse.Action):
    """Imports the native module only when asked, so that `--help` stays quick."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        import sanguine_core

        print(f"sanguine {sanguine_core.__version__}")
        parser.exit(0)


def _skin(options: argparse.Namespace) -> int:
    from ..app.skin_report import read_skins, report

    wavelengths_nm = _wavelengths(options.wavelengths)
    ids, skins = read_skins(options.skins)
    _answer(report(ids, skins, wavelengths_nm), options.out)
    return 0


def _blood(options: argparse.Namespace) -> int:
    from ..app.blood_report import asked_skins, report

    _answer(report(asked_skins(options.tone, options.skin), options.blood), options.out)
    return 0


def _solve(options: argparse.Namespace) -> int:
    from ..app.solving import answer, check_solver, read_cases
    from ..domain.files import check_file
    from .progress import reporter

    check_file(options.out)
    radii_mm = None if options.radii is None else _radii(options.radii)
    check_solver(options.solver)
    cases = read_cases(options.cases)
    with reporter(options.json_progress) as progress:
        report = answer(cases, options.solver, options.tolerance, radii_mm, options.max_seconds, progress)
    _answer(report, options.out)
    unsolved = [result for result in report["results"] if result["error"] is not None]
    for result in unsolved:
        print(f"sanguine: {options.cases}: {result['id']}: {result['error']}", file=sys.stderr)
    return 1 if unsolved else 0


def _fit(options: argparse.Namespace) -> int:
    from ..app.fitting import fit_report, read_spectra
    from ..domain.files import check_file
    from .progress import reporter

    check_file(options.out)
    spectra = read_spectra(options.spectra)
    free = [name for name in options.free.split(",") if name]
    with reporter(options.json_progress) as progress:
        report = fit_report(spectra, options.specular, free, lambda done, total: progress("fit", done, total) or True)
    if options.specular == "auto":
        print(f"sanguine: specular taken as {report['specular']} (--specular says otherwise)", file=sys.stderr)
    _answer(report, options.out)
    return 0


def _names(options: argparse.Namespace) -> int:
    from pathlib import Path

    from ..app.rig_names import names_report
    from ..domain.files import check_file
    from ..domain.naming import read_names

    check_file(options.out)
    _answer(names_report(options.rig, {Path(own).stem: read_names(own) for own in options.own}), options.out)
    return 0


def _capture(options: argparse.Namespace) -> int:
    from ..app.capture import capture, capture_report
    from ..domain.facs import DEFAULT_EMOTIONS
    from ..domain.files import check_file

    check_file(options.out)
    named = tuple(name for name in options.emotions.split(",") if name)
    emotions = {"on": DEFAULT_EMOTIONS, "off": ()}.get(options.emotions, named)
    performance = capture(
        options.recording, options.fps, options.smooth, emotions, options.source_fps, options.reduce, options.head == "on"
    )
    for note in performance.notes:
        print(f"sanguine: {note}", file=sys.stderr)
    _answer(capture_report(performance), options.out)
    return 0


def _invert(options: argparse.Namespace) -> int:
    from ..app.inverting import invert_file
    from ..app.skin_report import read_skins
    from ..domain.files import check_file
    from .progress import reporter

    check_file(options.out)
    noise = None
    if options.noise != "auto":
        try:
            noise = float(options.noise)
        except ValueError:
            noise = -1.0
        if not 0.0 <= noise < 100.0:
            raise InputError(f"--noise: {options.noise!r} is not auto or a number from 0 to below 100")
    skin = None
    if options.skin is not None:
        _, skins = read_skins(options.skin)
        if len(skins) != 1:
            raise InputError(f"{options.skin}: skins: {len(skins)} of them, one is needed")
        skin = skins[0]
    with reporter(options.json_progress) as progress:
        report = invert_file(options.albedo, options.out_dir, skin=skin, space=options.space, shading=options.shading,
                             noise=noise, progress=progress)
    for warning in report["warnings"]:
        print(f"sanguine: {warning}", file=sys.stderr)
    _answer(report, options.out)
    return 0


def _maps(options: argparse.Namespace) -> int:
    from ..app.growing import Request, feature_list, grow_maps
    from ..domain.files import check_file, check_folder
    from .progress import reporter

    if options.features == "list":
        _answer(feature_list(), options.out)
        return 0
    check_file(options.out)
    check_folder(options.out_dir)
    spectral = _wavelengths(options.spectral, "--spectral") if options.spectral else None
    request = Request(
        features=_strengths(options.features), tone=options.tone, sex=options.sex, age_years=options.age, sun=options.sun,
        seed=options.seed, skin_path=options.skin, size=options.size, spectral_nm=spectral, tx=options.tx,
        cache=options.cache,
    )
    with reporter(options.json_progress) as progress:
        report = grow_maps(options.face, _mesh_reader(options), options.out_dir, request,
                           lambda done, total: progress("texels", done, total) or True)
    for line in report["warnings"]:
        print(f"sanguine: {options.face}: {line}", file=sys.stderr)
    _answer(report, options.out)
    return 0


def _physiology(options: argparse.Namespace) -> int:
    from ..app.physiology import Settings, check_packages, make_profile, read_recordings, report, study, summary
    from ..app.physiology_plots import write_plots
    from ..domain.files import check_file, check_folder
    from ..domain.physiology.cleaning import Settling
    from ..domain.profile import Calibration, write_profile
    from .progress import reporter

    check_packages(options.plots is not None)
    check_file(options.out)
    check_file(options.profile)
    if options.plots is not None:
        check_folder(options.plots)
    lag_s = None
    if options.lag_s != "auto":
        try:
            lag_s = float(options.lag_s)
        except ValueError:
            raise InputError(f"--lag-s: {options.lag_s!r} is not auto or a number of seconds") from None
    settings = Settings(
        labels=_pairs(options.labels, "--labels"), ignore=tuple(filter(None, options.ignore.split(","))), lag_s=lag_s,
        settling=Settling(options.settle_s, options.recover_s, options.window_s),
        calibration=Calibration(
            index=options.index, index_gain=options.gain, melanin=options.melanin,
            index_region=tuple(filter(None, options.region.split(","))), oximeter=options.oximeter,
        ),
        profile_of=options.sex,
    )
    recordings = read_recordings(options.recordings, settings)
    with reporter(options.json_progress) as progress:
        done = study(recordings, settings, progress)
    profile = make_profile(done) if options.profile is not None else None
    if options.plots is not None:
        write_plots(done, options.plots)
    if profile is not None:
        write_profile(options.profile, profile)
    for line in (*done.warnings, *summary(done)):
        print(f"sanguine: {line}", file=sys.stderr)
    _answer(report(done), options.out)
    return 0


def _pairs(text: str, flag: str) -> dict[str, str]:
    pairs = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not (name.strip() and equals and value.strip()):
            raise InputError(f"{flag}: {part!r} is not OWN=EMOTION")
        pairs[name.strip()] = value.strip()
    return pairs


def _mesh_reader(options: argparse.Namespace) -> Any:
    """Reads a mesh file through Blender, which is loaded only when there is one to read."""

    def read(path: str) -> Any:
        with _needs_blender(f"{path}: mesh files need Blender"):
            from ..blender.meshes import read_mesh
        return read_mesh(path, options.object, options.unit)

    return read


def _strengths(text: str) -> dict[str, float]:
    strengths = {}
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        try:
            strengths[name] = float(value) if value else 1.0
        except ValueError:
            raise InputError(f"--features: {part!r} is not ID=NUMBER") from None
    return strengths


def _bench(options: argparse.Namespace) -> int:
    import importlib.util
    import subprocess
    from pathlib import Path

    script = Path(__file__).resolve().parents[2] / "bench" / f"{options.what}.py"
    if not script.is_file():
        raise InputError("bench: needs a checkout of the sources: its cases and scripts are not in the add-on")
    for module in ("colour", "iadpython", *([] if options.quick else ["matplotlib"])):
        if importlib.util.find_spec(module) is None:
            raise InputError(f"bench: no module '{module}': pip install --no-deps -r tools/requirements-bench.txt")
    # A process of its own: nothing that was loaded or computed before is in its times.
    flags = [*(["--quick"] if options.quick else []), *(["--out", options.out] if options.out is not None else [])]
    return subprocess.run([sys.executable, str(script), *flags]).returncode


def _plan(options: argparse.Namespace) -> int:
    from ..app.planning import example_face, plan_report
    from ..domain.effects.regions import FACE_REGIONS
    from ..domain.quality import choice
    from ..domain.shot import read_shot

    quality = choice(options.quality, options.delta_e)
    shot = read_shot(options.shot)
    _answer(plan_report(shot, FACE_REGIONS, quality, example_face(shot), _renderer()), options.out)
    return 0


def _renderer() -> Renderer:
    """What would render here: the Blender that runs this, else one of blender.org."""
    if "bpy" not in sys.modules:
        return Renderer()
    from ..blender.osl import missing_osl

    return Renderer(no_osl=missing_osl())


def _render(options: argparse.Namespace) -> int:
    from ..app.batch import render_batch
    from ..domain.files import check_folder
    from ..domain.quality import choice
    from ..domain.shot import jobs, read_shot
    from .progress import reporter

    only = [name for name in options.only.split(",") if name] if options.only is not None else None
    if options.shot.endswith(".blend"):
        return _render_scene(options, only)
    shot = read_shot(options.shot)
    quality = choice(options.quality, options.delta_e)
    check_folder(options.out)  # before Blender is loaded, which takes a second and may talk
    if only is not None:
        known = [job.id for job in jobs(shot)]
        for name in only:
            if name not in known:
                from ..domain.errors import nearest

                raise InputError(f"--only: no image '{name}' in {options.shot}, {nearest(name, known)}")
    with _needs_blender("render: no Blender module"):
        from ..blender.render import BlenderRenderer
    with reporter(options.json_progress) as progress:
        render_batch(shot, options.shot, options.out, BlenderRenderer(), only=only, resume=options.resume,
                     progress=progress, quality=quality, keep_blend=options.blend)
    return 0


def _render_scene(options: argparse.Namespace, only: list[str] | None) -> int:
    from ..app.scene_files import render_file
    from ..domain.files import check_folder
    from .progress import reporter

    for flag in ("quality", "delta_e", "blend"):
        if getattr(options, flag):
            raise InputError(f"--{flag.replace('_', '-')}: for a SHOT.toml; {options.shot} has its own settings")
    check_folder(options.out)
    scene = _scene_file(options.shot)
    with reporter(options.json_progress) as progress:
        notes = render_file(scene, options.shot, options.out, only, options.resume, progress)
    for note in notes:
        print(f"sanguine: {options.shot}: {note} (in memory alone: the file is not written)", file=sys.stderr)
    return 0


def _bake(options: argparse.Namespace) -> int:
    from ..app.scene_files import bake_file
    from .progress import reporter

    if options.check and options.save:
        raise InputError("--save: --check writes nothing, leave one of them out")
    scene = _scene_file(options.scene, options.name)
    with reporter(options.json_progress) as progress:
        report = bake_file(scene, None if options.check else options.save or options.scene, progress)
    for note in report["notes"]:
        print(f"sanguine: {options.scene}: {note}", file=sys.stderr)
    _answer(report, options.out)
    return 1 if options.check and report["stale"] else 0


def _scene_file(path: str, name: str = "") -> Any:
    from pathlib import Path

    if not Path(path).is_file():
        raise InputError(f"{path}: no such file")
    with _needs_blender(f"{path}: needs Blender"):
        from ..blender.scene_file import SceneFile
    return SceneFile(path, name)


@contextlib.contextmanager
def _needs_blender(what: str) -> Iterator[None]:
    """Around an import of `blender`: where there is no bpy, one line that begins with `what`."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in ("bpy", "_bpy"):
            raise
        raise InputError(f"{what}: run this inside Blender, or `pip install bpy==4.5.15`") from None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _share(text: str) -> float:
    value = _number(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and at most 1")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and finite")
    return value


def _gain(text: str) -> float:
    value = _number(text)
    if not 0.0 < value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and at most 100")
    return value


def _melanin(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value <= 0.5:
        raise argparse.ArgumentTypeError(f"{text} is not 0 to 0.5, a volume fraction of the epidermis")
    return value


def _seconds(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not 0 or more seconds")
    return value


def _radii(text: str) -> list[float]:
    if text == "none":
        return []
    try:
        radii = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--radii: {text!r} is not a list of millimetres like 0.1,1,10, or none") from None
    if not all(0.0 < a < b for a, b in zip([1e-300, *radii], [*radii, float("inf")])):
        raise InputError(f"--radii: {text!r} does not rise from above 0 mm")
    return radii


def _wavelengths(text: str, flag: str = "--wavelengths") -> Any:
    import numpy as np

    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            if not step > 0 or not first <= last or (last - first) / step > 100_000:
                raise ValueError
            # The slack lets 380:780:0.1 end on 780 whatever the rounding.
            values = first + step * np.arange(int((last - first) / step + 1e-9) + 1)
        else:
            values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise InputError(f"{flag}: {text!r} is not FIRST:LAST:STEP or a list like 450,550,650 (nm)") from None
    if not np.all((values >= 380.0) & (values <= 780.0)):
        raise InputError(f"{flag}: {text!r} leaves 380 to 780 nm")
    return values


def _answer(data: dict[str, Any], out: str | None) -> None:
    if out is None:
        json.dump(data, sys.stdout, indent=1, allow_nan=False)
        print()
    else:
        from ..domain.files import write_json

        write_json(out, data)


if __name__ == "__main__":
    sys.exit(main())
