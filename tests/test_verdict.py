"""What is concluded of laws from what they leave of a record: statistics alone, no motion."""

from __future__ import annotations

from stickslip.law.verdict import CERTAIN, SUPPORTED, Evidence, Misfit, _within, seen_above, standings

EVIDENCE = Evidence({("x", 0): 30.0, ("load", 0): 30.0}, {("x", 0): 1e-6, ("load", 0): 1e-3})


def misfit(name: str, count: int, size: float) -> Misfit:
    return Misfit(name, count, {("x", 0): size * 1e-10, ("load", 0): size * 1e-4})


def kept(*misfits: Misfit, likely: dict[str, float] | None = None) -> tuple[set[str], float]:
    ranking, confidence = standings(misfits, EVIDENCE, likely=likely)
    return {law.name for law in ranking if law.kept}, confidence


def test_a_family_is_rejected_by_the_stories_that_tell_against_it() -> None:
    """The same misfit, told by a few stories and by many."""
    pair = [misfit("LuGre", 5, 1.5), misfit("compliant", 3, 1.0)]
    assert kept(*pair)[0] == {"compliant"}
    assert kept(misfit("LuGre", 5, 1.05), misfit("compliant", 3, 1.0))[0] == {"LuGre", "compliant"}
    few = Evidence({("x", 0): 5.0, ("load", 0): 5.0}, EVIDENCE.noise)
    assert all(standing.kept for standing in standings(pair, few)[0])


def test_a_rigid_law_may_leave_more_on_a_rough_surface() -> None:
    assert kept(misfit("Coulomb", 1, 2.5), misfit("compliant", 3, 1.0))[0] == {"compliant"}
    assert kept(misfit("Coulomb", 1, 1.6), misfit("compliant", 3, 1.0))[0] == {"Coulomb", "compliant"}
    assert kept(misfit("compliant", 3, 1.6), misfit("Coulomb", 1, 1.0))[0] == {"Coulomb"}


def test_confidence_grows_with_the_misfit_of_the_others() -> None:
    verdicts = [kept(misfit("Coulomb", 1, size), misfit("compliant", 3, 1.0)) for size in (2.2, 2.4, 4.0, 100.0)]
    assert [left for left, _ in verdicts] == [{"compliant"}] * 4
    levels = [confidence for _, confidence in verdicts]
    assert levels == sorted(levels)
    assert 0.95 < levels[0] < 0.99 < levels[2]
    assert levels[-1] <= CERTAIN


def test_no_more_is_said_than_rigs_of_known_laws_have_shown() -> None:
    """Of as many rigs as had worse odds for the truth than a law that is rejected, and one more for the rig itself."""
    assert seen_above(0.0) == CERTAIN
    levels = [seen_above(odds) for odds in (0.0, 0.01, 0.05, 0.2, 1.0)]
    assert levels == sorted(levels, reverse=True)
    assert levels[-1] < levels[0] < 1


def test_no_more_than_the_best_of_those_tried_is_claimed_where_it_leaves_more_than_noise() -> None:
    """One channel is enough: what left 1.24 times its noise was told at 99.5 %, and the friction was none of them."""
    for left, most in ((1.1, CERTAIN), (1.24, SUPPORTED)):
        squares = {("x", 0): (left * 1e-6) ** 2, ("load", 0): 1e-6}
        assert Evidence(EVIDENCE.counts, EVIDENCE.noise, squares).supported == most


def test_at_the_same_misfit_the_law_of_fewer_parameters_leads() -> None:
    """Of a law of which the friction around rest tells nothing, an added parameter is no proof."""
    shares = _within(
        [misfit("Coulomb", 1, 1.0), misfit("asymmetric", 2, 1.0)], EVIDENCE, {"Coulomb": 0.6, "static": 0.4}
    )
    assert next(iter(shares)) == "Coulomb"
    assert (
        _within([misfit("Coulomb", 1, 3.0), misfit("asymmetric", 2, 1.0)], EVIDENCE, {"Coulomb": 0.6})["Coulomb"] < 0.05
    )


def test_one_of_two_that_are_left_is_surer_than_either() -> None:
    left, confidence = kept(misfit("Coulomb", 1, 1.2), misfit("compliant", 3, 1.0))
    assert left == {"Coulomb", "compliant"}
    assert confidence == CERTAIN


def test_a_misfit_within_the_noise_decides_nothing() -> None:
    quiet = Evidence({("x", 0): 30.0}, {("x", 0): 1e-6})
    ranking, _ = standings([Misfit("Coulomb", 1, {("x", 0): 1e-14}), Misfit("compliant", 3, {("x", 0): 1e-15})], quiet)
    assert all(law.kept for law in ranking)
    assert ranking[0].name == "Coulomb"


def test_rigid_laws_are_told_apart_by_the_friction_around_rest() -> None:
    """And by their misfit only where it is far larger: a rough surface makes the true law leave more."""
    plain, rich = misfit("Coulomb", 1, 1.0), misfit("static", 2, 0.95)
    assert kept(plain, rich, likely={"Coulomb": 0.001, "static": 0.999})[0] == {"static"}
    assert kept(plain, rich, likely={"Coulomb": 0.99, "static": 0.01})[0] == {"Coulomb"}
    assert kept(plain, rich, likely={"Coulomb": 0.6, "static": 0.4})[0] == {"Coulomb", "static"}
    assert kept(plain, rich)[0] == {"Coulomb", "static"}
    rough = {"Coulomb": 0.77, "Stribeck": 0.23}
    assert kept(misfit("Coulomb", 1, 1.6), misfit("Stribeck", 3, 1.0), likely=rough)[0] == {"Coulomb", "Stribeck"}
    assert kept(misfit("Coulomb", 1, 1.6), misfit("Stribeck", 3, 1.0), likely=rough)[1] == CERTAIN
    assert kept(plain, misfit("static", 2, 0.4))[0] == {"static"}


def test_further_parameters_that_explain_nothing_more_are_rejected() -> None:
    """Where the records tell many stories; few leave the richer law possible."""
    many = Evidence({("x", 0): 300.0, ("load", 0): 300.0}, EVIDENCE.noise)
    pair = [misfit("compliant", 3, 1.0), misfit("LuGre", 5, 1.05)]
    ranking, confidence = standings(pair, many)
    assert [law.name for law in ranking if law.kept] == ["compliant"]
    assert confidence > 0.9
    assert kept(misfit("compliant", 3, 1.0), misfit("LuGre", 5, 1.0))[0] == {"compliant", "LuGre"}


def stiff(name: str, count: int, size: float) -> Misfit:
    return Misfit(name, count, misfit(name, count, size).squares, stiff=True)


def test_a_contact_next_to_rigid_is_no_other_family() -> None:
    ranking, confidence = standings(
        [misfit("Coulomb", 1, 1.0), stiff("compliant", 3, 0.9), misfit("LuGre", 5, 50.0)], EVIDENCE
    )
    assert [law.name for law in ranking if law.kept] == ["Coulomb"]
    assert next(law for law in ranking if law.name == "compliant").limit
    assert confidence > 0.9


def test_a_stiff_contact_that_leaves_far_less_stands_for_itself() -> None:
    """A half more is what a rough surface makes a rigid law leave that is true."""
    ranking, _ = standings([misfit("Coulomb", 1, 3.0), stiff("compliant", 3, 1.0)], EVIDENCE)
    assert [law.name for law in ranking if law.kept] == ["compliant"]
    assert not any(law.limit for law in ranking)
    both = [misfit("Coulomb", 1, 1.5), stiff("compliant", 3, 1.0)]  # a rough surface may have done so, or the contact
    assert [law.name for law in standings(both, EVIDENCE)[0] if law.kept] == ["compliant", "Coulomb"]
    ranking, _ = standings([misfit("Coulomb", 1, 1.05), stiff("compliant", 3, 1.0)], EVIDENCE)
    assert [law.name for law in ranking if law.kept] == ["Coulomb"]


def test_how_many_parameters_a_stiff_contact_has_makes_it_no_rigid_one() -> None:
    """They count in its odds: it leaves 1.4 times less, and is neither excluded nor alone."""
    ranking, _ = standings([misfit("Coulomb", 1, 1.4), stiff("LuGre", 5, 1.0)], EVIDENCE)
    assert {law.name for law in ranking if law.kept} == {"Coulomb", "LuGre"}
    assert not any(law.limit for law in ranking)


def test_a_stiff_contact_stands_beside_a_law_of_another_family_that_leads() -> None:
    """A state variable led a rigid law by 1.7 times, and a contact that gave way and left no more was excluded."""
    stiff_contact = stiff("compliant", 3, 1.0)
    assert kept(misfit("state variable", 3, 1.0), misfit("Coulomb", 1, 1.6), stiff_contact)[0] == {
        "state variable",
        "Coulomb",
        "compliant",
    }
    assert "compliant" not in kept(misfit("state variable", 3, 1.0), misfit("Coulomb", 1, 1.0), stiff_contact)[0]
