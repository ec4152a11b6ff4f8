"""Base of all tables of a camera file."""

from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from lumigraph.instruments.problems import readable


class Part(BaseModel):
    """A table of a camera file. Whatever is wrong with it is one line that names the field."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, populate_by_name=True)

    def __init__(self, **values: Any) -> None:
        try:
            self.__pydantic_validator__.validate_python(values, self_instance=self)
        except ValidationError as error:
            raise readable(error, type(self)) from None

    # Parts inside a camera are validated by the camera, which knows their place and whether a file is read.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]
