"""The OpenCV window, with the properties of windows of different toolkits."""
import cv2
import numpy as np
import pytest

from ros_3d_bb.visualization import cv_window

VISIBLE, AUTOSIZE = cv2.WND_PROP_VISIBLE, cv2.WND_PROP_AUTOSIZE


@pytest.fixture
def properties(monkeypatch):
    """Properties of the window; there is no display."""
    values = {}
    monkeypatch.setattr(cv_window, '_check_display', lambda: None)
    for name in ('namedWindow', 'resizeWindow', 'imshow'):
        monkeypatch.setattr(cv2, name, lambda *arguments: None, raising=False)
    monkeypatch.setattr(cv2, 'getWindowProperty', lambda title, which: values[which], raising=False)
    return values


@pytest.mark.parametrize('toolkit, shown, closed', [
    ('GTK, OpenCV 4.2.0 and 4.5.1', {VISIBLE: -1, AUTOSIZE: 0}, {VISIBLE: -1, AUTOSIZE: -1}),
    ('Qt, OpenCV 4.6.0', {VISIBLE: 1, AUTOSIZE: 0}, {VISIBLE: 0, AUTOSIZE: 0})])
def test_a_window_is_closed_when_its_user_closes_it(properties, toolkit, shown, closed):
    window = cv_window.Window('test')
    assert not window.is_closed
    properties.update(shown)
    window.show(np.zeros((4, 4, 3), np.uint8))
    assert not window.is_closed
    properties.update(closed)
    assert window.is_closed
