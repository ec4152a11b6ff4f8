"""Public names and where they come from; `lazy_loader` reads this file, and so do type checkers."""

from .built import Built as Built
from .camera import Camera as Camera
from .description import Description as Description, Row as Row
from .files import catalogue as catalogue
from .instrument import Instrument as Instrument
from .lenslet_camera import LensletCamera as LensletCamera
from .lenslets import Lenslets as Lenslets
from .loading import load_camera as load_camera
from .microscope import LightFieldMicroscope as LightFieldMicroscope
from .microscope_objective import MicroscopeObjective as MicroscopeObjective
from .over_field import OverField as OverField
from .parts import MainLens as MainLens, Pixels as Pixels
from .plenoptic1 import PlenopticCamera as PlenopticCamera
from .plenoptic2 import FocusedPlenopticCamera as FocusedPlenopticCamera
from .single_lens import SingleLensCamera as SingleLensCamera
from .tolerances import Tolerance as Tolerance
