"""Appearance of tracked people: by the colours of the clothes, the track of a box, and the ID of a person who returns.

The appearance of a box is that of `estimation.appearance`. The evidence that it shows the person of a track is a
likelihood ratio: colours of one person vary little from image to image, those of different people vary much. A part of
the body that is hidden, or shows what the person carries, may have any colour, so that a part is little evidence
against a track. If other people look alike, their clothes are common at this place, and the evidence is weak.
"""
import math
from typing import Any, Dict, Iterable, NamedTuple, Optional, Sequence, Tuple

from ros_3d_bb.core.time_sync import NS

# Standard deviations of the six numbers of a part of one person (upper and lower body alike) from image to image, and
# of the difference of two people. Measured on the two people of data/piv/corridor, rounded up: 0.07 to 0.13 and 0.3,
# 0.07 to 0.16 and 0.25, 0.2 to 0.5 and 0.6.
SAME, OTHER = (0.13, 0.12, 0.5), (0.4, 0.3, 0.7)
# All below are chosen.
WRONG_SHARE = 0.1  # of the parts: hidden, or of something else than clothes
MOST_ALIKE = 3.0  # bound of the evidence for the association: a wrong colour must not move a track far
MOST_IMAGES = 20  # number of images over which the colours are averaged
LEAST_SUPPORT = 0.5  # of the boxes whose colours are learned
LEAST_IMAGES = 3  # that show a part of a person who can be recognised
RETURN_NS = 300 * NS  # a person who returns later gets a new ID: lights and clothes change
RETURN_ODDS = 4.0  # that a new track is the person who has left, and not another one
RETURN_MPS, RETURN_M = 2.0, 1.0  # people return no faster than this
MOST_DEPARTED = 50
Ratios = Tuple[Optional[float], ...]  # of the upper and of the lower body; None: unknown


class Appearance(NamedTuple):
    """Mean colours of a person (6,), and the number of images that show the upper and the lower body."""

    mean: Tuple[float, ...] = (0.0,) * 6
    images: Tuple[int, int] = (0, 0)

    def updated(self, colors: Sequence[float]) -> 'Appearance':
        """The Appearance after an image with these colours."""
        mean, images = list(self.mean), list(self.images)
        for part in (0, 1):
            if colors[3 * part + 2]:
                images[part] = min(images[part] + 1, MOST_IMAGES)
                for place in range(3 * part, 3 * part + 3):
                    mean[place] += (colors[place] - mean[place]) / images[part]
        return Appearance(tuple(mean), (images[0], images[1]))

    @property
    def is_known(self) -> bool:
        """Whether the person can be recognised."""
        return max(self.images) >= LEAST_IMAGES

    @property
    def is_new(self) -> bool:
        """Whether so few images show the person that it may turn out to be another one."""
        return max(self.images) <= LEAST_IMAGES

    def ratios(self, colors: Sequence[float]) -> Ratios:
        """Likelihood ratios of the colours (6,) of a box, for this person against any other one: of the upper and of
        the lower body, None where it is unknown."""
        return tuple(_ratio(self.mean[start:start + 3], colors[start:start + 3], images)
                     if images and colors[start + 2] else None
                     for start, images in zip((0, 3), self.images))


def _ratio(mean: Sequence[float], colors: Sequence[float], images: int) -> float:
    log_ratio = 0.0
    for known, seen, same, other in zip(mean, colors, SAME, OTHER):
        same2, other2 = (1 + 1 / images) * same * same, other * other
        log_ratio += (math.log(other2 / same2) + (seen - known) ** 2 * (1 / other2 - 1 / same2)) / 2
    return (1 - WRONG_SHARE) * math.exp(log_ratio) + WRONG_SHARE


def evidence_of_pairs(tracks: Sequence[Any], measurements: Sequence[Any]) -> Dict[Tuple[int, int], float]:
    """The evidence {(number of the track, number of the measurement): log-likelihood ratio} that each pair is one
    person, where both appearances are known, from 0 to `MOST_ALIKE`.

    Colours that differ are no evidence against a pair: light, other people and what a person carries change them, and
    among people who are dressed alike, nothing would outweigh that. Equal ones are seldom a coincidence.
    """
    known = [(row, track) for row, track in enumerate(tracks) if track.appearance is not None]
    found = {}
    for column, measurement in enumerate(measurements if known else ()):
        colors, group = measurement.detection.appearance, measurement.kind.group
        if colors is not None:
            ratios = {row: track.appearance.ratios(colors) for row, track in known if track.kind.group == group}
            people = [row for row in ratios if tracks[row].is_confirmed]
            for row in ratios:
                evidence = _evidence(ratios[row], [ratios[other] for other in people if other != row])
                found[row, column] = min(max(evidence, 0.0), MOST_ALIKE)
    return found


def _evidence(ratios: Ratios, others: Sequence[Ratios]) -> float:
    """Logarithm of the likelihood ratios of a person, relative to the mean of those of `others` and of anyone else."""
    total = 0.0
    for part, ratio in enumerate(ratios):
        if ratio is not None:
            alike = [value for value in (other[part] for other in others) if value is not None]
            total += math.log(ratio * (1 + len(alike)) / (1 + sum(alike)))
    return total


class Departed(NamedTuple):
    """A person whose track has ended: its ID, group of classes, first stamp, Appearance, the IDs of the people who were
    seen together with this one (frozenset), and the latest detection."""

    id: int
    group: object
    first_ns: int
    appearance: Appearance
    met: frozenset
    x: float
    y: float
    last_ns: int

    @classmethod
    def of(cls, track: Any) -> 'Departed':
        """The Departed of a track."""
        return cls(track.id, track.kind.group, track.first_ns, track.appearance, track.met, track.latest.x,
                   track.latest.y, track.last_ns)


def departed_after(departed: Tuple[Departed, ...], deleted: Iterable[Any], stamp_ns: int) -> Tuple[Departed, ...]:
    """The tuple of people who may return, after the tracks `deleted` end."""
    known = [Departed.of(track) for track in deleted if track.is_confirmed and track.appearance is not None
             and track.appearance.is_known]
    if not (departed or known):
        return departed
    return tuple([person for person in departed if stamp_ns - person.last_ns < RETURN_NS] + known)[-MOST_DEPARTED:]


def meet(tracks: Iterable[Any]) -> None:
    """Remember that the people of the tracks, which are detected in one image, are different ones."""
    ids = frozenset(track.id for track in tracks if track.is_confirmed)
    for track in tracks:
        if track.appearance is not None and not ids <= track.met | {track.id}:
            track.met = track.met | ids - {track.id}


def returned(track: Any, others: Iterable[Any], departed: Iterable[Departed]) -> Optional[Departed]:
    """The Departed that a new track shows: one of the `departed`, or of the confirmed tracks `others` that has not been
    seen together with it; None if this is not likely enough.

    People who were seen together with the best candidate or with the track are different people. If they look alike, a
    return is less likely. Candidates who were never seen together may be the same person.
    """
    candidates = [Departed.of(other) for other in others if other.appearance is not None] + list(departed)
    ratios = {person.id: person.appearance.ratios(track.appearance.mean)
              for person in candidates if person.group == track.kind.group}
    possible = [person for person in candidates if person.id in ratios and person.id not in track.met
                and person.appearance.is_known and _can_return(person, track)]
    if not possible:
        return None
    best = max(possible, key=lambda person: _evidence(ratios[person.id], []))
    alike = [ratios[number] for number in ratios if number in best.met or number in track.met]
    return best if _odds(ratios[best.id], alike) >= RETURN_ODDS else None


def _odds(ratios: Ratios, others: Iterable[Ratios]) -> float:
    """Odds that a box shows a person, and not one of `others`, given the likelihood ratios."""
    odds = 1.0
    for part, ratio in enumerate(ratios):
        if ratio is not None:
            odds *= ratio / (1 + sum(other[part] or 0 for other in others))
    return odds


def _can_return(person: Departed, track: Any) -> bool:
    """Whether a person can have come to the first place of a track."""
    elapsed_s = (track.last_ns - person.last_ns) / NS
    distance_m = math.hypot(person.x - track.latest.x, person.y - track.latest.y)
    return person.last_ns < track.first_ns and distance_m < RETURN_M + RETURN_MPS * elapsed_s
