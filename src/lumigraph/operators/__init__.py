"""Linear image formers: from objects to raw images, and back; each is a `core.linear.Linear`.

- `periodic`: `periodic_operator`, incoherent planes before a lenslet array, and its adjoint
- `kernels`: its matrices; `optics`, what they depend on; `blocks`, how they are made, in factors; `cells`,
  what they are matrices between; `point_images`, where they come from; `cell_response`, what lenslets do to
  light; `glare`, what falls far from a point's image
- behind lenslets that are not square: `lenslet_light`, one at a time; `few_points`, from which all points'
  images follow; `missing`, what lenslets beyond the border take away
- `points`, `white`: single points, and the evenly lit main lens, before lenslets; `relay`, any light through
  lenslets, cell by cell; `each`, where they differ, one by one; `point_light`, a point's light in their plane
- `part_images`: points by a camera's parts; `part_points`, one by one, with derivatives by place;
  `part_exact`, before exact lenslets; `part_lens`, without any; `part_leaning`, where parts lean;
  `part_plane`, whole planes; `film_plane`, without lenslets; `plane_of_points`, where no image repeats;
  `sample_images`, an operator of those; `part_sight`, `part_waves`, `passed`, `line_parts`, what all are
  made of; `exact_waves`, light that is a sum over directions
- `whole_planes`: what planes by the parts of any instrument share; `part_volume`, several of them
- `screens`: opaque sheets before the main lens; `partly`, planes whose points they hide in part
- `regrid`: an operator of an object on another grid, moved or finer
- `resampling`, `turning`: from an object's samples to points and from the image's samples to pixels
- `single_lens`: `single_lens_operator`, incoherent planes and points before a camera without lenslets
- `microscope_operator`: volumes before a light-field microscope; `microscope_building`, how it is made;
  `microscope_cell`, a lenslet and its cell; `microscope_tiles`, lenslets in tiles;
  `microscope_kernels`, images of its points; `microscope_rays`, the same by rays; `microscope_spectrum`, the
  lenslets' frequencies; `microscope_transforms`, to those and back; `microscope_patterns`, what they follow
  of a cell's points; `microscope_sensor`, from those to pixels;
  `microscope_pupil`, points by the pupil's phase; `microscope_pupil_waves`, its waves behind lenslets;
  `pupil_points`, points by a microscope's parts; `pupil_plane`, whole planes; `pupil_cells`, their columns;
  `microscope_pixels`, real pixels; `microscope_samples`, how many samples they need; `fourier_microscope`;
  `fourier_points`, its points with derivatives; `fourier_changes`, by its parts; `fourier_plane`, planes
- `exact`: lenslets and distances beyond the paraxial; `paraxial`, how far off that is
- `varying`: main lenses whose aberrations change over the field; `let`, the share of each sample; `mirrors`,
  what is known of one field, of those that mirror it
- `leaning`: arrays and sensors that lean, by cameras that do not
- `fineness`: what an accuracy asks for
- `band`: band-limited samples along an axis, to and from points and pixels
- `camera`: `CameraOptics`, what an operator reads of an instrument, as plain values
"""

from lumigraph.operators.lenslets.paraxial_error import is_possible
from lumigraph.operators.periodic.incoherent import PeriodicOperator, periodic_operator
from lumigraph.operators.sampling.camera import CameraOptics, HasOptics, Model
from lumigraph.operators.single_lens import SingleLensOperator, single_lens_operator

__all__ = [
    "CameraOptics",
    "HasOptics",
    "Model",
    "PeriodicOperator",
    "SingleLensOperator",
    "is_possible",
    "periodic_operator",
    "single_lens_operator",
]


def __dir__() -> list[str]:
    return __all__
