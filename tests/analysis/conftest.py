"""One browser for the pages of all analyses, whose tests run no event loop that Playwright's would be in the way of."""

import pytest

from tests.browser import launched

chromium = pytest.fixture(scope="package")(launched)
