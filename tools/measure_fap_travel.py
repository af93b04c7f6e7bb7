"""Writes rigs/mpeg4_travel.csv anew: how far each shape key of the example heads moves MPEG-4's feature points, as FAP.

Run after a change of the heads, their keys, or the points in rigs/mpeg4.toml.
"""

import csv

import sanguine_core

from sanguine.domain.head import build_head, load_presets, load_regions
from sanguine.domain.mpeg4 import measure_travel
from sanguine.domain.resources import rigs_path


def main() -> None:
    presets, regions = load_presets(rigs_path("heads.toml")), load_regions(rigs_path("regions.toml"))

    def travel(name):
        return measure_travel(build_head(presets[name], regions, lambda p: sanguine_core.read_image(str(p))[::-1]))

    female, male = travel("female"), travel("male")
    with (rigs_path("mpeg4.toml").with_name("mpeg4_travel.csv")).open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["fap", "key", "female", "male"])
        for i, fap in enumerate(female.faps):
            for j, key in enumerate(female.keys):
                values = round(female.steps[i, j]), round(male.steps[i, j])
                if any(values):
                    rows.writerow([fap, key, *values])


if __name__ == "__main__":
    main()
