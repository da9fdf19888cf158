"""Shares of body mass and height: the thesis's Tables 3.1 to 3.3 recomputed, and laws that any segment obeys."""

import numpy as np
import pytest

from pellucid.models.anthropometry import Segment, de_leva, rod, shank_length, winter

# Mass, height, measured length from knee to heel, and what Table 3.3 prints: m, l, I, m g l.
SUBJECTS = {
    "S1": (54.0, 1.63, 0.42, 3.294, 0.2545, 0.345, 8.225),
    "S2": (68.0, 1.78, 0.55, 4.148, 0.333, 0.6771, 13.56),
    "S3": (52.0, 1.62, 0.46, 3.172, 0.2788, 0.363, 8.674),
}


@pytest.mark.parametrize("name", SUBJECTS)
def test_mass_centre_and_gravity_of_table_3_3_come_out_again(name):
    mass, _, length, m, centre, _, gravity = SUBJECTS[name]
    segment = winter(mass, length)
    assert segment.mass == pytest.approx(m, abs=5e-4)
    assert segment.centre == pytest.approx(centre, abs=3.5e-4)
    assert segment.gravity(9.81) == pytest.approx(gravity, abs=0.01)


def test_inertia_of_table_3_3_comes_out_for_two_subjects_and_not_for_the_first():
    found = {name: winter(s[0], s[2]).inertia for name, s in SUBJECTS.items()}
    assert found["S2"] == pytest.approx(0.6779, abs=1e-4)
    assert found["S3"] == pytest.approx(0.3626, abs=1e-4)
    assert found["S1"] == pytest.approx(0.3139, abs=1e-4)  # printed 0.345
    # The printed one belongs to a length of 0.44 m.
    assert winter(54.0, 0.44).inertia == pytest.approx(0.345, abs=1e-3)


def test_the_ankle_is_nearer_than_the_heel_that_the_thesis_measured():
    """Winter's shares go with knee to ankle: gravity and inertia are then smaller than those of Table 3.3."""
    theirs = {name: winter(s[0], s[2]) for name, s in SUBJECTS.items()}
    ours = {name: winter(s[0], shank_length(s[1])) for name, s in SUBJECTS.items()}
    assert [ours[n].gravity() for n in SUBJECTS] == pytest.approx([7.85, 10.80, 7.51], abs=0.01)
    assert [ours[n].inertia for n in SUBJECTS] == pytest.approx([0.286, 0.430, 0.272], abs=1e-3)
    assert all(ours[n].gravity() < theirs[n].gravity() for n in SUBJECTS)
    to_sole = [shank_length(s[1], to="sole") for s in SUBJECTS.values()]
    assert to_sole == pytest.approx([0.465, 0.507, 0.462], abs=1e-3)


def test_the_orthosis_needs_two_lengths_for_one_symbol():
    """m g l = 1.524 N m goes with l = 0.21 m, the inertia 0.0435 kg m^2 only with twice that."""
    assert rod(0.74, 2.0 * 0.21).gravity(9.81) == pytest.approx(1.524, abs=1e-3)
    assert rod(0.74, 0.42).inertia == pytest.approx(0.0435, abs=1e-4)
    assert rod(0.74, 0.21).inertia == pytest.approx(0.0109, abs=1e-4)


@pytest.mark.parametrize("sex", ["female", "male"])
def test_two_tables_agree_on_the_same_person(sex):
    a, b = de_leva(60.0, 1.7, sex), winter(60.0, shank_length(1.7))
    assert a.mass == pytest.approx(b.mass, rel=0.08)
    assert a.gravity() == pytest.approx(b.gravity(), rel=0.10)
    assert a.inertia == pytest.approx(b.inertia, rel=0.15)


@pytest.mark.parametrize("make", [lambda m, s: winter(m, 0.43 * s), lambda m, s: de_leva(m, 1.7 * s, "male")])
def test_scaling_a_person_scales_the_segment(make):
    """Twice the mass: twice everything; larger by s: centre by s, inertia by s squared."""
    one, heavy, tall = make(60.0, 1.0), make(120.0, 1.0), make(60.0, 1.3)
    assert (heavy.mass, heavy.inertia, heavy.centre) == pytest.approx((2 * one.mass, 2 * one.inertia, one.centre))
    assert (tall.mass, tall.inertia, tall.centre) == pytest.approx((one.mass, 1.69 * one.inertia, 1.3 * one.centre))


@pytest.mark.parametrize(
    "segment", [winter(70.0, 0.43), de_leva(70.0, 1.75, "female"), de_leva(70.0, 1.75, "male"), rod(0.7, 0.4)]
)
def test_no_body_has_less_inertia_than_its_centre_of_mass_asks(segment: Segment):
    assert segment.inertia > segment.mass * segment.centre**2


def test_measured_length_replaces_the_share_of_height():
    by_height = de_leva(70.0, 1.75, "male")
    same = de_leva(70.0, 1.75, "male", length=0.4403 / 1.741 * 1.75)
    assert same == by_height
    assert de_leva(70.0, 1.75, "male", length=0.5).gravity() > by_height.gravity()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: winter(-1.0, 0.4), "mass: found -1.0, expected a positive"),
        (lambda: winter(60.0, np.nan), "length: found nan"),
        (lambda: de_leva(60.0, 1.7, "other"), "sex: found 'other'"),
        (lambda: shank_length(1.7, to="toe"), "to: found 'toe'"),
        (lambda: shank_length(0.0), "height: found 0.0"),
    ],
)
def test_nonsense_is_refused(call, said):
    with pytest.raises(ValueError, match=said):
        call()
