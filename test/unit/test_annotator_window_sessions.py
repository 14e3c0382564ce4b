"""Window of the annotator: all kinds of sessions, other programs, keys, export and analysis."""
import os
from unittest import mock

import cv2
import numpy as np
import pytest

from ros_3d_bb_annotator import document as document_module, main_window
from ros_3d_bb_annotator.document import Document
from support.old_session import write_old_session
from support.small_session import change_json, read_json, write_measurement, write_small_session
from support.window import ALT, CONTROL, SHIFT, Qt, QtCore, QtGui, QtWidgets, opened


def message_of(box):
    return box.text() + box.informativeText()


def is_handled_by(field, sequence):
    """Whether a field handles a key (QKeySequence) itself, so that it triggers no action."""
    code = sequence[0]
    modifiers = Qt.KeyboardModifiers(code & int(Qt.KeyboardModifierMask))
    key = code & ~int(Qt.KeyboardModifierMask)
    text = chr(key) if modifiers == Qt.NoModifier and key < 128 else ''
    event = QtGui.QKeyEvent(QtCore.QEvent.ShortcutOverride, key, modifiers, text)
    event.ignore()
    QtWidgets.QApplication.sendEvent(field, event)
    return event.isAccepted()


def test_typed_text_is_restored(drive, window_on, folder):
    drive.press('12', Qt.Key_Tab, '2.')
    drive.press(Qt.Key_PageDown)
    assert drive.window.pane.truth.fields['x'].text() == ''
    drive.press(Qt.Key_PageUp)
    assert [drive.window.pane.truth.fields[name].text() for name in 'xz'] == ['12', '2.']
    drive.press('5')
    drive.wait_for(lambda: Document.open(folder).draft(0).get('x') == '5')  # what was selected is replaced
    again = window_on(folder)
    assert again.window.pane.truth.fields['x'].text() == '5' and again.measurement(0).state == 'new'


@pytest.fixture
def fast_refresh(monkeypatch):
    monkeypatch.setattr(main_window, 'REFRESH_MS', 20)


def test_changes_by_other_programs_are_shown(fast_refresh, window_on, folder):
    drive = window_on(folder)
    drive.press('12')
    entry = write_measurement(folder, 'm4')
    change_json(folder, lambda content: content['frames'].append(entry))
    drive.wait_for(lambda: drive.window.list.table.model().rowCount() == 5)
    assert drive.window.pane.truth.fields['x'].text() == '12' and drive.window.current == 0
    assert drive.window.progress.text() == '0 of 5 done'
    drive.press((Qt.Key_End, ALT), '34')
    change_json(folder, lambda content: content['frames'].pop())
    drive.wait_for(lambda: drive.window.list.table.model().rowCount() == 4)
    assert drive.window.current == 0 and drive.window.pane.truth.fields['x'].text() == '12'


def test_the_first_measurement_of_an_empty_session_is_shown(fast_refresh, window_on, tmp_path):
    driver = window_on(write_small_session(str(tmp_path), count=0))
    driver.press(Qt.Key_PageDown, (Qt.Key_L, CONTROL), (Qt.Key_N, CONTROL), '1')
    assert driver.window.current is None and driver.window.progress.text() == '0 of 0 done'
    entry = write_measurement(str(tmp_path), 'm0')
    change_json(str(tmp_path), lambda content: content['frames'].append(entry))
    driver.wait_for(lambda: driver.window.current == 0)
    assert driver.window.pane.color_view.image is not None and driver.window.pane.truth.isEnabled()


def test_all_actions_are_in_the_overview_and_have_keys_of_their_own(drive):
    text = drive.answer(lambda dialog: dialog.findChild(QtWidgets.QTextBrowser).toPlainText(),
                        lambda: drive.press(Qt.Key_F1))
    keys = [key.toString() for action in drive.window.actions.values() for key in action.shortcuts()]
    assert len(keys) == len(set(keys)) and all(action.shortcuts() for action in drive.window.actions.values())
    for action in drive.window.actions.values():
        assert action.text().replace('&', '').rstrip('…') in text
        assert action.shortcuts()[0].toString() in text


def test_each_action_has_a_key_that_fields_do_not_handle(drive):
    drive.press(Qt.Key_F4)
    for name in set(drive.window.actions) - {'undo', 'redo'}:  # the field handles them if there is text to be undone
        keys = drive.window.actions[name].shortcuts()
        assert not all(is_handled_by(drive.window.pane.truth.fields['x'], key) for key in keys), name


def test_an_invalid_session_gives_a_message(window_on, tmp_path):
    (tmp_path / 'frames.json').write_text('[]')
    was_opened = []
    driver = window_on(write_small_session(str(tmp_path / 'good')))
    message = driver.answer(message_of, lambda: was_opened.append(driver.window.open_session(str(tmp_path))))
    assert 'an object with frames expected' in message and str(tmp_path) in message
    assert was_opened == [False] and len(driver.document.measurements) == 4  # the old one stays open


@pytest.mark.parametrize('kind, image, problem', [
    ('depth', np.zeros((48, 64), np.uint8), '16-bit'), ('depth', np.zeros((24, 32), np.uint16), '32 x 24'),
    ('color', None, 'm0.png'), ('color', np.zeros((48, 64), np.uint8), '8-bit colour image')])
def test_a_missing_or_invalid_image_is_named_in_its_view(window_on, folder, kind, image, problem):
    path = os.path.join(folder, kind, 'm0.png')
    os.remove(path)
    if image is not None:
        cv2.imwrite(path, image)
    driver = window_on(folder)
    view, other = driver.window.pane.color_view, driver.window.pane.depth_view
    if kind == 'depth':
        view, other = other, view
    assert view.image is None and problem in view.message and other.image is not None
    driver.press('-480', Qt.Key_Tab, '2050', Qt.Key_Return)
    assert opened(folder)[0].truth_m == (-0.48, None, 2.05)


def test_the_old_format_opens_and_lost_data_are_reported(window_on, tmp_path):
    driver = window_on(write_old_session(str(tmp_path), (
        '[(-7, 3, 300), (971, 535, 2102)];30-03-2021-11-49-54', '[no position];30-03-2021-11-50-01')))
    pane = driver.window.pane
    assert 'cannot be recovered' in pane.banner.text() and pane.banner.isVisible()
    assert pane.color_view.image is not None and pane.depth_view.image is not None and pane.people.count() == 2
    driver.press((Qt.Key_2, ALT), '1000', Qt.Key_Tab, '2000', Qt.Key_Return)
    assert 'X −29 mm, Z +102 mm' in driver.window.last_entry.text()
    assert 'measurements.txt' in pane.header.text()
    pane.color_view.setFocus()
    driver.press(Qt.Key_PageUp)
    pane.shared.point_at(5, 5)
    assert pane.readout.text() == 'pixel (5, 5)'
    message = driver.answer(message_of, lambda: driver.drag(
        pane.color_view, *[pane.color_view.transform().map(QtCore.QPointF(*point)) for point in ((9, 9), (30, 30))],
        SHIFT))
    assert 'distances cannot be recovered' in message


def test_an_edit_that_cannot_be_saved_gives_a_message(drive, folder):
    os.rename(os.path.join(folder, 'frames.json'), os.path.join(folder, 'away.json'))
    os.mkdir(os.path.join(folder, 'frames.json'))
    message = drive.answer(message_of, lambda: drive.press('-500', Qt.Key_Tab, '2000', Qt.Key_Return))
    assert folder in message
    assert drive.window.pane.truth.fields['z'].text() == '2000'


def test_only_images_of_shown_measurements_are_read(window_on, tmp_path, monkeypatch):
    folder = write_small_session(str(tmp_path), count=1)
    change_json(folder, lambda content: content.update(
        frames=[dict(content['frames'][0], id='m%04d' % number) for number in range(5000)]))
    reads = []
    for name in ('read_color', 'read_depth'):
        original = getattr(document_module, name)
        monkeypatch.setattr(document_module, name, lambda frame, what, original=original: (
            reads.append(frame.id), original(frame, what))[1])
    listdir = mock.Mock(side_effect=os.listdir)
    monkeypatch.setattr(os, 'listdir', listdir)
    driver = window_on(folder)
    assert listdir.call_count <= 2  # both folders, not each file
    driver.wait_for(lambda: len(reads) == 4)  # colour and depth of the first, and of the next one in advance
    del reads[:]
    driver.press(*[Qt.Key_PageDown] * 20)
    driver.wait_for(lambda: 'm0021' in reads)
    assert sorted(set(reads)) == ['m%04d' % number for number in range(2, 22)] and len(reads) == 2 * 20
    driver.press((Qt.Key_End, ALT))
    driver.wait_for(lambda: 'm4998' in reads)
    assert driver.window.current == 4999 and len(reads) == 2 * 22


@pytest.mark.slow
@pytest.mark.filterwarnings('ignore:.*divide:RuntimeWarning')  # equal images: the error is all bias
def test_export_and_analysis(window_on, tmp_path):
    folder = write_small_session(str(tmp_path), count=24)
    truth = [(x, z) for x in (-600, -450, -300) for z in (1800, 2000, 2300)]
    change_json(folder, lambda content: [entry.update(truth_mm=dict(zip('xz', truth[number % 9])))
                                         for number, entry in enumerate(content['frames'][:23])])
    driver = window_on(folder)
    driver.window.results.export(str(tmp_path / 'table.csv'))
    assert len((tmp_path / 'table.csv').read_text().splitlines()) == 24
    driver.press((Qt.Key_A, CONTROL | SHIFT))
    driver.wait_for(lambda: driver.window.results.figures is not None)
    figures = driver.window.results.figures
    assert figures.names.count() == 7  # no model, and no figure of it: the bias is too steep
    assert figures.picture.pixmap().width() > 500
    first = figures.picture.pixmap().cacheKey()
    figures.names.setCurrentRow(1)
    assert figures.picture.pixmap().cacheKey() != first
    figures.close()


def test_navigation_and_a_failed_analysis_do_not_change_the_session(drive, folder):
    before = read_json(folder)
    drive.press(Qt.Key_PageDown, Qt.Key_PageUp, Qt.Key_F3, '+', '-', '0', Qt.Key_P)
    message = drive.answer(message_of, lambda: drive.press((Qt.Key_A, CONTROL | SHIFT)))
    assert 'no frame with ground truth' in message
    drive.close()
    assert read_json(folder) == before
