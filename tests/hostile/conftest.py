"""What the tests of hostile scenes share."""

import pytest

from asmjax.render import untrusted
from hostile.watching import Opens, listener


@pytest.fixture(scope="module")
def opens(tmp_path_factory):
    """What native code of the children opens; None where nothing can listen."""
    folder = tmp_path_factory.mktemp("listener")
    environment = listener(folder)
    if environment is None:
        yield None
        return
    before = untrusted._environment
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(untrusted, "_environment", lambda: before() | environment)
        yield Opens(folder / "opens")
