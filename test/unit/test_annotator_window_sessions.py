"""Window of the annotator: all kinds of sessions, other programs, keys, export and analysis."""
import os

import cv2
import numpy as np
import pytest

from ros_3d_bb_annotator import main_window
from support.small_session import change_json, write_measurement, write_small_session
from support.window import ALT, CONTROL, SHIFT, Qt, QtGui


def message_of(box):
    return box.text() + box.informativeText()


def test_typed_text_stays_until_it_is_entered_or_another_measurement_is_shown(drive):
    fields = drive.window.pane.truth.fields
    drive.press('-500', Qt.Key_Tab, '2100', (Qt.Key_2, ALT), (Qt.Key_1, ALT))
    assert [fields[name].text() for name in 'xz'] == ['-500', '2100']
    drive.press(Qt.Key_F4, Qt.Key_Return, Qt.Key_PageUp)
    assert drive.measurement(0).truth_m == (-0.5, None, 2.1)
    drive.press('12', Qt.Key_PageDown)
    assert fields['x'].text() == ''
    drive.press(Qt.Key_PageUp)
    assert fields['x'].text() == '-500'


@pytest.fixture
def fast_refresh(monkeypatch):
    monkeypatch.setattr(main_window, 'REFRESH_MS', 20)


def test_changes_by_other_programs_are_shown(fast_refresh, window_on, folder):
    drive = window_on(folder)
    drive.press('12')
    entry = write_measurement(folder, 'm4')
    change_json(folder, lambda content: content['frames'].append(entry))
    drive.wait_for(lambda: drive.window.list.model().rowCount() == 5)
    assert drive.window.pane.truth.fields['x'].text() == '12' and drive.window.current == 0
    assert drive.window.progress.text() == '0 of 5 done'
    drive.window.show_measurement(4)
    drive.press('34')
    change_json(folder, lambda content: content['frames'].pop())
    drive.wait_for(lambda: drive.window.list.model().rowCount() == 4)
    assert drive.window.current == 0 and drive.window.pane.truth.fields['x'].text() == ''


def test_a_measurement_after_a_deleted_one_is_shown_with_its_image(fast_refresh, window_on, folder):
    drive = window_on(folder)
    drive.window.show_measurement(3)
    before_m = drive.document.estimates.of(3)[0][2]
    entry = write_measurement(folder, 'm4')  # as d and s in the viewer
    path = os.path.join(folder, entry['depth'])
    cv2.imwrite(path, cv2.imread(path, cv2.IMREAD_UNCHANGED) - np.uint16(500))
    change_json(folder, lambda content: content['frames'].__setitem__(3, entry))
    drive.wait_for(lambda: drive.measurement(3).id == 'm4')
    assert drive.document.estimates.of(3)[0][2] == pytest.approx(before_m - 0.5, abs=0.02)
    shown = drive.window.pane.depth_view.image
    drive.window.show_measurement(2)
    assert drive.window.pane.depth_view.image != shown


def test_an_invalid_session_gives_a_message(window_on, tmp_path):
    (tmp_path / 'frames.json').write_text('[]')
    was_opened = []
    driver = window_on(write_small_session(str(tmp_path / 'good')))
    message = driver.answer(message_of, lambda: was_opened.append(driver.window.open_session(str(tmp_path))))
    assert 'an object with frames expected' in message and str(tmp_path) in message
    assert was_opened == [False] and len(driver.document.measurements) == 4  # the old one stays open


@pytest.mark.slow
@pytest.mark.filterwarnings('ignore:.*divide:RuntimeWarning')  # equal images: the error is all bias
def test_export_and_analysis(window_on, monkeypatch, tmp_path):
    folder = write_small_session(str(tmp_path), count=24)
    truth = [(x, z) for x in (-600, -450, -300) for z in (1800, 2000, 2300)]
    change_json(folder, lambda content: [entry.update(truth_mm=dict(zip('xz', truth[number % 9])))
                                         for number, entry in enumerate(content['frames'][:23])])
    driver = window_on(folder)
    driver.window.results.export(str(tmp_path / 'table.csv'))
    assert len((tmp_path / 'table.csv').read_text().splitlines()) == 24
    opened = []
    monkeypatch.setattr(QtGui.QDesktopServices, 'openUrl', lambda url: opened.append(url.toLocalFile()))
    driver.press((Qt.Key_A, CONTROL | SHIFT))
    driver.wait_for(lambda: opened)
    assert opened == [os.path.join(folder, 'analysis', 'report.html')] and os.path.exists(opened[0])
    assert driver.window.results.analysis.model_note  # the bias is too steep
    assert 'no error_model.yaml is written' in driver.window.statusBar().currentMessage()
