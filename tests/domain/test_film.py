"""The film's albedo: right where it is known, and in the table as good as computed."""

import numpy as np
import pytest
import sanguine_core
from sanguine.domain.film import ENTRIES, film_albedo, film_table, fresnel
from sanguine.domain.parameters import default_skin, skin_rows

INDEX = sanguine_core.OIL_FILM_INDEX


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.3, 0.1])
def test_a_mirror_reflects_what_fresnel_says(cosine):
    assert film_albedo(cosine, 1e-3, INDEX) == pytest.approx(float(fresnel(np.array(cosine), INDEX)), rel=0.01)


def test_average_over_all_views_is_the_solvers_film():
    """Facets of little slope return what a smooth film does, which is what `sanguine skin` counts with."""
    squares = (np.arange(200) + 0.5) / 200
    mean = np.mean([film_albedo(cosine, 0.02, INDEX) for cosine in np.sqrt(squares)])
    skins = skin_rows([default_skin() | {"oil": 1.0}])
    assert mean == pytest.approx(sanguine_core.surface(skins)[0, 0], rel=0.02)


def test_table_between_its_entries():
    """Linear between entries as the shader does it, at views up to 87 degrees and every roughness from 0.1 on."""
    table = film_table(INDEX)
    for roughness in np.linspace(0.1, 1.0, 19):
        for cosine in np.linspace(0.05, 1.0, 20):
            column, row = np.sqrt([cosine, roughness]) * (ENTRIES - 1)
            left, low = min(int(column), ENTRIES - 2), min(int(row), ENTRIES - 2)
            across = table[low : low + 2, left : left + 2] @ [left + 1 - column, column - left]
            found = across @ [low + 1 - row, row - low]
            assert found == pytest.approx(film_albedo(cosine, roughness, INDEX), abs=0.002)
