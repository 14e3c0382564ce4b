import os
import re

import numpy as np
import pytest
import yaml

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import (CLASSES, MAX_CLASSES, MAX_IN_GROUP, PERSON_CLASS, ObjectClass, ObjectClasses,
                                           object_classes_from, read_object_classes)
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FILE = os.path.join(ROOT, 'config', 'classes.yaml')
CAMERA = Camera(640, 480, 600.0, 600.0, 320.0, 240.0)


def table(**classes):
    return {'classes': dict({'person': {}}, **classes)}


def test_the_example_of_a_class_can_be_added_to_the_file():
    with open(FILE) as file, open(os.path.join(ROOT, 'doc', 'detectors.md'), encoding='utf-8') as page:
        line, = re.findall(r'add a line, such as `(.*)`', page.read())
        assert object_classes_from(load_yaml('%s  %s' % (file.read(), line))).of('forklift').length == 2.5


def test_the_file_is_the_table_in_the_code():
    assert read_object_classes(FILE) == read_object_classes('') == ObjectClasses()
    with open(FILE) as stream:
        assert set(yaml.safe_load(stream)) == {'default', 'classes'}


def test_classes_are_looked_up_by_name():
    classes = object_classes_from(dict(table(dog={'group': 'pet', 'width': 1}, cat={'group': 'pet'}),
                                       default={'height': 0.5}))
    assert classes.of('dog') == ObjectClass('pet', width=1.0) and classes.of('drone') == ObjectClass(height=0.5)
    assert classes.group_of('dog') == classes.group_of('cat') == 'pet'
    assert (classes.group_of('drone'), classes.group_of('person')) == ('drone', 'person')


@pytest.mark.parametrize('content, reason', [
    (None, 'the keys classes'), ({'classes': {'dog': {}}}, 'the class person is missing'),
    (table(dog=5), 'dog is 5; a mapping expected'), (table(dog={'widht': 1}), 'did you mean width'),
    (table(dog={'width': -1}), 'dog.width is -1; a number from 0 to 10 expected'),
    (table(dog={'width': True}), 'dog.width is True'), (table(dog={'group': ''}), 'dog.group'),
    (dict(table(), default={'group': 'pet'}), 'default.group'),
    (table(**{'a;b': {}}), '1 to 64 printable'), ({'classes': {'person': {}, 3: {}}}, 'text expected, in quotes'),
    (table(**{'class %d' % number: {} for number in range(MAX_CLASSES)}), '201 classes; at most 200'),
    (table(**{'class %d' % number: {'group': 'a'} for number in range(MAX_IN_GROUP + 1)}), 'the group a has 9')])
def test_invalid_tables_are_rejected(content, reason):
    with pytest.raises(ValueError, match=reason):
        object_classes_from(content)


@pytest.mark.parametrize('label, behind_m', [('chair', 0.18), ('dog', None), ('drone', 0.25), ('person', 0.09)])
def test_a_box_has_the_distance_of_its_class(label, behind_m):
    depth_mm = np.full((480, 640), 5000, np.uint16)
    depth_mm[150:350, 270:371] = 3000  # 0.5 m wide
    box, = estimate_boxes(DepthImage(depth_mm, 0.001), [(270, 150, 371, 350)], CAMERA, estimator_named('foreground'),
                          labels=[label])
    behind_m = CLASSES['dog'].axis_behind(box.size_m[0]) if behind_m is None else behind_m
    assert box.label == label and box.center_m[2] == pytest.approx(3 + behind_m, abs=0.015)


@pytest.mark.parametrize('label, width_m, height_m', [('person', 0.373, 1.7), ('chair', 0.4, 0.9), ('drone', 0.2, 0.4)])
def test_truncated_boxes_are_completed_to_the_height_and_towards_the_width_of_their_class(label, width_m, height_m):
    depth_mm = np.full((480, 640), 5000, np.uint16)
    depth_mm[400:, :41] = 3000
    box, = estimate_boxes(DepthImage(depth_mm, 0.001), [(0, 400, 41, 480)], CAMERA, estimator_named('foreground'),
                          labels=[label])
    assert box.size_m[:2] == pytest.approx([width_m, height_m], abs=0.02)


def test_people_have_several_names_unless_these_are_listed():
    assert [ObjectClasses().standard_name(label) for label in ('pedestrian', 'HUMAN', 'Dog')] == [
        'person', 'person', 'Dog']
    table = ObjectClasses({'person': PERSON_CLASS, 'pedestrian': PERSON_CLASS._replace(height=1.6)})
    assert table.standard_name('pedestrian') == 'pedestrian' and table.standard_name('Human') == 'person'
