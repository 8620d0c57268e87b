from ._bullet import BULLET_VERSION as BULLET_VERSION
from ._bullet import PRECISION as PRECISION
from ._bullet import World as World
