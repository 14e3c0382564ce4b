"""Classes of objects as numbers, for arrays of tracks and measurements."""
import numpy as np

from ros_3d_bb.core.object_classes import MAX_IN_GROUP, ObjectClasses

MAX_UNLISTED = 1000  # class names that are not in the table; further ones are not distinguished
OTHER = 'other'  # name of these


class ClassNumbers(object):
    """Numbers of the classes of a table (`object_classes.ObjectClasses`); other classes get the next free numbers.

    Attributes
    ----------
    labels : list of str
        Class names by number.
    group, member : numpy.ndarray, (classes,)
        Number of the group of each class, and its index in the group.
    size : numpy.ndarray, (groups,)
        Number of classes of each group.
    numbers : numpy.ndarray, (groups, MAX_IN_GROUP)
        Number of the class of each group and index in the group; unused entries have that of the first member.
    acceleration, initial_speed, width_m : numpy.ndarray, (classes,)
        As in `object_classes.ObjectClass`.
    """

    def __init__(self, table=ObjectClasses()):
        self._table, self._unlisted = table, 0
        self._numbers, self.labels, self._groups = {}, [], {}
        for label in table.listed:
            self._add(label)
        self._index()

    def of(self, label):
        """Number of a class name."""
        if label not in self._numbers:
            if self._unlisted >= MAX_UNLISTED and label != OTHER:
                return self.of(OTHER)
            self._unlisted += 1
            self._add(label)
            self._index()
        return self._numbers[label]

    def _add(self, label):
        self._numbers[label] = len(self.labels)
        self.labels.append(label)
        group = self._table.group_of(label) if label in self._table.listed else (label,)  # a group of its own
        self._groups.setdefault(group, []).append(self._numbers[label])

    def _index(self):
        self.group, self.member = np.zeros((2, len(self.labels)), int)
        self.numbers = np.zeros((len(self._groups), MAX_IN_GROUP), int)
        for group, numbers in enumerate(self._groups.values()):
            self.group[numbers], self.member[numbers] = group, np.arange(len(numbers))
            self.numbers[group] = numbers[0]
            self.numbers[group, :len(numbers)] = numbers
        self.size = np.array([len(numbers) for numbers in self._groups.values()])
        classes = [self._table.of(label) for label in self.labels]
        self.acceleration = np.array([known.acceleration for known in classes])
        self.initial_speed = np.array([known.initial_speed for known in classes])
        self.width_m = np.array([known.width for known in classes])
