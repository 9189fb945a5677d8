"""The one line that a user gets where something cannot be done."""

import pytest

from cccd.errors import InputError


def refusal(call, *arguments, **options) -> str:
    """The line with which a call is refused."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    return str(caught.value)
