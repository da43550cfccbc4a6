from distfsi.api import load as load
from distfsi.api import open as open
from distfsi.api import run as run
from distfsi.errors import DistfsiError as DistfsiError
from distfsi.errors import Diverged as Diverged
from distfsi.errors import InputError as InputError
from distfsi.errors import OutputError as OutputError
from distfsi.errors import Stopped as Stopped

__version__: str
