import os

import numpy as np
import pytest

from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.marks import Mark
from support.small_session import FAR_BOX, NEAR_BOX, change_json, write_small_session
from support.window import CONTROL, SHIFT, Qt, QtCore, QtGui, QtWidgets, opened


def place_in(view, x, y, panel=0):
    return view.transform(panel).map(QtCore.QPointF(x, y))


def test_the_error_of_a_typed_truth_is_shown_and_enter_saves_it(drive, folder):
    drive.press('-476.5', Qt.Key_Tab, '2050')
    assert 'X −29 mm, Z +40 mm' in drive.window.pane.truth.error_label.text() and drive.measurement(0).truth_m is None
    drive.press(Qt.Key_Return)
    assert opened(folder)[0].truth_m == (-0.4765, None, 2.05)
    assert drive.window.current == 1 and drive.window.progress.text() == '1 of 4 done'
    assert 'X −29 mm, Z +40 mm' in drive.window.last_entry.text()
    drive.press('-0,5 m', Qt.Key_Tab, '2.1m', Qt.Key_Tab, '-30', Qt.Key_Return)
    assert opened(folder)[1].truth_m == (-0.5, -0.03, 2.1) and drive.window.current == 2
    drive.press((Qt.Key_Z, CONTROL))
    assert opened(folder)[1].truth_m is None and drive.window.current == 1


@pytest.mark.parametrize('panel', [0, 1])
def test_a_click_on_a_box_or_its_list_entry_selects_it(drive, folder, panel):
    view = drive.window.pane.images
    drive.click(view, place_in(view, *np.mean([FAR_BOX[:2], FAR_BOX[2:]], axis=0), panel))
    assert opened(folder)[0].person == 1
    view.zoom_by(2, (20, 24))
    drive.click(view, place_in(view, NEAR_BOX[2] - 1, 24, panel))
    assert opened(folder)[0].person == 0
    drive.click(view, place_in(view, 33, 24, panel))  # between the people
    assert opened(folder)[0].person == 0
    people = drive.window.pane.people
    people.scrollToItem(people.item(1))
    drive.click(people.viewport(), QtCore.QPointF(people.visualItemRect(people.item(1)).center()))
    assert opened(folder)[0].person == 1


def test_a_box_is_drawn_with_shift_and_drag_unless_it_is_tiny(drive, folder):
    view = drive.window.pane.images
    drive.drag(view, place_in(view, 20.5, 20.5), place_in(view, 22.5, 22.5), SHIFT)
    assert len(drive.measurement(0).detections) == 2 and not drive.document.undo_steps
    drive.drag(view, place_in(view, 11.5, 5.5), place_in(view, 25.5, 43.5), SHIFT)
    drawn = opened(folder)[0].detections[2]
    assert drawn.box_px == (11, 5, 26, 44) and drawn.by_hand and opened(folder)[0].person == 2
    assert 1.9 < drawn.estimate_m[2] < 2.2


def test_a_click_on_a_mark_sets_the_truth(drive, folder):
    floor = drive.window.pane.floor
    drive.click(floor, floor.place_of(-0.5, 2.0) + QtCore.QPointF(3, -3))
    assert opened(folder)[0].truth_m == (-0.5, None, 2.0) and drive.window.current == 1
    drive.click(floor, floor.place_of(0.3, 1.0))  # nothing there
    assert opened(folder)[1].truth_m is None


def test_marks_are_edited_in_a_dialog(drive, folder):
    def add_incomplete_mark(dialog):
        QtCore.QTimer.singleShot(0, lambda: labels.append(dialog.labelText()) or add_mark(dialog))
        dialog.setTextValue(dialog.textValue() + '\nB1, 0, 2000\nB2, 0')
        dialog.accept()

    def add_mark(dialog):
        dialog.setTextValue(dialog.textValue() + ', 3 m')
        dialog.accept()
    labels = []
    drive.answer(add_incomplete_mark, lambda: drive.press((Qt.Key_G, CONTROL)))
    assert 'line 3' in labels[0]
    assert Document(folder).grid == (Mark('A1', -0.5, 2.0), Mark('B1', 0, 2), Mark('B2', 0, 3))
    drive.press((Qt.Key_Z, CONTROL))
    assert Document(folder).grid == (Mark('A1', -0.5, 2.0),)


def test_reject_asks_for_a_reason_and_restore_undoes_it(drive, folder):
    drive.answer(lambda dialog: dialog.reject(), lambda: drive.press((Qt.Key_R, CONTROL)))
    assert drive.measurement(0).state == 'new' and drive.window.current == 0

    def give_reason(dialog):
        box = dialog.findChild(QtWidgets.QComboBox)
        box.setEditText('moved')
        dialog.accept()
    drive.answer(give_reason, lambda: drive.press((Qt.Key_R, CONTROL)))
    assert opened(folder)[0].rejected == 'moved' and drive.window.current == 1
    drive.press(Qt.Key_PageUp)
    assert 'reason: moved' in drive.window.pane.header.text() and 'rejected' in drive.window.last_entry.text()
    drive.press((Qt.Key_R, CONTROL | SHIFT))
    assert opened(folder)[0].state == 'new' and drive.window.last_entry.text() == ''


def test_boxes_are_deleted(drive, folder):
    drive.press((Qt.Key_D, CONTROL | SHIFT))
    assert [one.box_px for one in opened(folder)[0].detections] == [FAR_BOX]
    drive.press((Qt.Key_Z, CONTROL))
    assert len(opened(folder)[0].detections) == 2


def test_truth_and_rejection_are_entered_for_all_selected_measurements(drive, folder):
    drive.window.list.setFocus()
    drive.press((Qt.Key_Down, SHIFT), (Qt.Key_Down, SHIFT), Qt.Key_F4)
    assert drive.window.selection == [0, 1, 2]
    drive.press('-500', Qt.Key_Tab, '2100', Qt.Key_Return)
    assert [one.state for one in opened(folder)] == ['annotated'] * 3 + ['new'] and drive.window.selection == [3]
    drive.window.list.setFocus()
    drive.press((Qt.Key_Up, SHIFT))
    drive.answer(lambda dialog: (dialog.setTextValue('no person'), dialog.accept()),
                 lambda: drive.press((Qt.Key_R, CONTROL)))
    assert [one.state for one in opened(folder)] == ['annotated'] * 2 + ['rejected'] * 2


def message_of(box):
    return box.text() + box.informativeText()


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
