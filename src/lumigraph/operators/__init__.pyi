"""Public names and where they come from; `lazy_loader` reads this file, and so do type checkers."""

from .lenslets.paraxial_error import is_possible as is_possible
from .periodic.incoherent import PeriodicOperator as PeriodicOperator, periodic_operator as periodic_operator
from .sampling.camera import CameraOptics as CameraOptics, HasOptics as HasOptics, Model as Model
from .single_lens import (
    SingleLensOperator as SingleLensOperator,
    single_lens_operator as single_lens_operator,
)
