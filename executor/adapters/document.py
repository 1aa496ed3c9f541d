"""JSON documents as models: who writes one and who reads one go by them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from executor.adapters.run_directory import write_json
from executor.errors import LogError
from missions import format_first_error

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Tenths = Annotated[Number, AfterValidator(partial(round, ndigits=1))]
Hundredths = Annotated[Number, AfterValidator(partial(round, ndigits=2))]
Thousandths = Annotated[Number, AfterValidator(partial(round, ndigits=3))]
Whole = Annotated[int, Field(strict=True)]
YesNo = Annotated[bool, Field(strict=True)]


class Document(BaseModel):
    """A JSON object; keys that it does not know, of a later version, are passed over."""

    model_config = ConfigDict(frozen=True)

    @classmethod
    def build_from(cls, source: object, **more: object) -> Self:
        """Return the document of a value.

        Args:
            source: What it has under the names of this document is taken as it is.
            more: What it does not have, or has in another form.
        """
        same = {name: getattr(source, name) for name in cls.model_fields if name not in more and hasattr(source, name)}
        return cls.model_validate({**same, **more})

    def to_plain(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return self.model_dump(mode="json")

    def write(self, path: Path) -> None:
        """Write it, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        write_json(path, self.to_plain())

    @classmethod
    def read(cls, path: Path, expected: str) -> Self:
        """Read it.

        Args:
            path: Its file.
            expected: What it is, in words.

        Raises:
            LogError: one line that names the file, the key and what was expected.
        """
        try:
            return cls.model_validate_json(path.read_bytes())
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}; expected {expected}") from error
        except ValidationError as error:
            raise LogError(f"{path}: {format_first_error(error)}") from error
