"""Find the muscle and the side that a channel's label names: full names, common abbreviations, labels of vendors.

This is the only place that knows names of muscles. Abbreviations are those of SENIAM's and the vendors' lists of sensor
locations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

MUSCLE_NAMES = {
    "rectus_femoris": ("rectusfemoris", "rectfem", "recfem", "rf", "rectofemoral", "rectus", "rfem", "rfm",
                       "rettofemorale", "droitfémoral", "droitfemoral"),
    "vastus_lateralis": ("vastuslateralis", "vaslat", "vastlat", "vl", "vastolateral", "vlo", "vlat",
                         "vastolaterale", "vastelatéral", "vastelateral"),
    "vastus_medialis": ("vastusmedialis", "vasmed", "vastmed", "vm", "vastomedial", "vmo", "vmed",
                        "vastomediale", "vastemédial", "vastemedial"),
    "vastus_intermedius": ("vastusintermedius", "vasint"),
    "biceps_femoris": ("bicepsfemoris", "bf", "bicepsf", "bfem", "hamstringslateral", "lateralhamstrings", "lham",
                       "latham", "bicipitefemorale", "bicepsfemoral"),
    "biceps_femoris_long": ("bifemlh", "bicfemlong", "bflh", "bicfem"),
    "biceps_femoris_short": ("bifemsh", "bfsh"),
    "semitendinosus": ("semitendinosus", "semiten", "st", "semitend", "semitendinoso", "sten", "mham",
                       "medham", "medialhamstrings", "hamstringsmedial"),
    "semimembranosus": ("semimembranosus", "semimem", "semimemb", "sm", "smem"),
    "tibialis_anterior": ("tibialisanterior", "tibant", "ta", "antertibialis", "tibialanterior", "tibialis",
                          "tibialeanteriore", "jambierantérieur", "jambieranterieur"),
    "tibialis_posterior": ("tibialisposterior", "tibpost", "tp"),
    "soleus": ("soleus", "sol", "so", "soléaire", "soleo"),
    "gastrocnemius_medialis": (
        "gastrocnemiusmedialis", "medgas", "gasmed", "gm", "mg", "gastmed", "medgast", "gam", "medialgastrocnemius",
        "gmed_gastroc", "gasm", "mgas", "medgastroc", "gastrocmed", "gastrocnemiusmedial", "gastrocnemiomediale",
        "gemelointerno",
    ),
    "gastrocnemius_lateralis": (
        "gastrocnemiuslateralis", "latgas", "gaslat", "gl", "lg", "gastlat", "latgast", "gal", "lateralgastrocnemius",
        "gasl", "lgas", "latgastroc", "gastroclat", "gastrocnemiuslateral", "gastrocnemiolaterale", "gemeloexterno",
    ),
    "gastrocnemius": ("gastrocnemius", "gastroc", "gas", "gastrocs", "ga"),
    "peroneus_longus": ("peroneuslongus", "perlong", "pl", "fibularislongus", "perl", "peroneus"),
    "peroneus_brevis": ("peroneusbrevis", "perbrev", "fibularisbrevis"),
    "hamstrings": ("hamstrings", "hamstring", "hams", "ham"),
    "quadriceps": ("quadriceps", "quads", "quad"),
    "gluteus_maximus": ("gluteusmaximus", "glutmax", "gmax", "glmax"),
    "gluteus_medius": ("gluteusmedius", "glutmed", "gmed", "glmed"),
    "gluteus_minimus": ("gluteusminimus", "glmin"),
    "adductor_longus": ("adductorlongus", "addlong"),
    "adductor_magnus": ("adductormagnus", "addmag"),
    "gracilis": ("gracilis", "grac"),
    "sartorius": ("sartorius", "sart"),
    "iliopsoas": ("iliopsoas", "psoas"),
    "tensor_fasciae_latae": ("tfl", "tensorfasciaelatae", "tensorfascialata"),
    "biceps": ("biceps", "bicepsbrachii", "bic", "bb", "bicep", "bicepsb"),
    "triceps": ("triceps", "tricepsbrachii", "tri", "tb", "tricep", "tricepsb"),
    "triceps_lateral": ("tricepslateralhead", "trilat", "triceplateral"),
    "triceps_long": ("tricepslonghead", "trilong", "triceplong"),
    "triceps_surae": ("tricepssurae",),
    "brachialis": ("brachialis", "brach"),
    "brachioradialis": ("brachioradialis", "brachrad", "brd", "brachiorad", "brr"),
    "pronator_teres": ("pronatorteres",),
    "supinator": ("supinator",),
    "flexor_carpi_radialis": ("flexorcarpiradialis", "fcr", "flexcarprad"),
    "flexor_carpi_ulnaris": ("flexorcarpiulnaris", "fcu", "flexcarpuln"),
    "extensor_carpi_radialis": ("extensorcarpiradialis", "ecr", "ecrl", "extcarprad"),
    "extensor_carpi_ulnaris": ("extensorcarpiulnaris", "ecu", "extcarpuln"),
    "flexor_digitorum": ("flexordigitorum", "fds", "flexordigitorumsuperficialis", "flexdig"),
    "extensor_digitorum": ("extensordigitorum", "edc", "extensordigitorumcommunis", "extdig"),
    "extensor_digitorum_longus": ("extensordigitorumlongus", "edl"),
    "first_dorsal_interosseous": ("firstdorsalinterosseous", "fdi"),
    "abductor_pollicis_brevis": ("abductorpollicisbrevis", "apb"),
    "deltoid_anterior": ("anteriordeltoid", "deltant", "antdelt", "deltoidanterior", "deltoideusanterior", "ad"),
    "deltoid_medial": (
        "mediallydeltoid", "deltmed", "meddelt", "lateraldeltoid", "deltoidmedial", "middledeltoid", "deltoidmiddle",
        "mediusdeltoid",
    ),
    "deltoid_posterior": ("posteriordeltoid", "deltpost", "postdelt", "deltoidposterior", "deltoideusposterior"),
    "deltoid": ("deltoid", "delt", "deltoideus"),
    "infraspinatus": ("infraspinatus", "infra"),
    "latissimus_dorsi": ("latissimusdorsi", "latdorsi", "lats", "latdors"),
    "serratus_anterior": ("serratusanterior", "serant", "seratusanterior"),
    "trapezius_upper": ("uppertrapezius", "trapeziusupper", "uppertrap", "trapu", "ut", "trapeziusdescendens"),
    "trapezius_middle": ("middletrapezius", "trapeziusmiddle", "midtrap"),
    "trapezius_lower": ("lowertrapezius", "trapeziuslower", "lowertrap"),
    "trapezius": ("trapezius", "trap"),
    "pectoralis_major": ("pectoralismajor", "pecmaj", "pec", "pecs", "pmaj"),
    "sternocleidomastoid": ("sternocleidomastoid", "scm"),
    "rectus_abdominis": ("rectabd", "rectusabdominis", "rectusabdominus", "ra"),
    "external_oblique": ("externaloblique", "extobl", "obliquusexternus", "obliquusexternusabdominis"),
    "internal_oblique": ("internaloblique", "intobl", "obliquusinternus"),
    "multifidus": ("multifidus", "multifidii", "mult"),
    "iliocostalis": ("iliocost", "iliocostalis"),
    "longissimus": ("longissimus",),
    "longissimus_lumborum": ("longlumb",),
    "longissimus_thoracis": ("longthor",),
    "erector_spinae": ("erectorspinae", "es", "lumbares", "errectorspinae"),
}  # fmt: skip
"""Spellings of muscle names without blanks, in lower case. Two or three letters alone also need a spectrum of EMG."""

SIDE_WORDS = {
    "left": ("l", "left", "lt", "li", "links", "linke", "izq", "izquierdo", "gauche", "sx", "sin", "sinister"),
    "right": ("r", "right", "rt", "re", "rechts", "rechte", "der", "derecho", "droit", "dx", "dex", "dexter"),
}
"""Words of the sides of a body."""

_MODIFIERS = {
    "med": "medialis", "medial": "medialis", "medialis": "medialis", "lat": "lateralis", "lateral": "lateralis",
    "ant": "anterior", "anterior": "anterior", "anterioris": "anterior", "post": "posterior", "posterior": "posterior",
}  # fmt: skip
"""Words that several muscles' names share, as labels shorten them."""

_FILLERS = frozenset({
    "emg", "semg", "hdemg", "raw", "filt", "filtered", "rect", "rectified", "rms", "env", "envelope", "ch", "chan",
    "channel", "sensor", "trigno", "avanti", "im", "imu", "delsys", "noraxon", "cometa", "picoemg", "electrode",
    "muscle", "musculus", "m", "musc", "voltage", "analog", "signal", "data", "value", "norm", "normalised", "mvc",
    "normalized", "activation", "v", "mv", "uv", "surface", "ultium", "mini", "wave", "bipolar", "dev",
    "adc", "a", "in", "aux", "ai", "imported", "multiple",
})  # fmt: skip
"""Words of labels that name no muscle."""


_OTHER_READINGS = {
    "gm": ("gluteus_maximus", "gluteus_medius"), "rectus": ("rectus_abdominis",), "tp": ("trapezius",),
    "ad": ("adductor_longus",), "biceps": ("biceps_femoris",), "bicep": ("biceps_femoris",),
    "bic": ("biceps_femoris",), "triceps": ("triceps_surae",), "tricep": ("triceps_surae",),
    "tri": ("triceps_surae",), "tibialis": ("tibialis_posterior",), "peroneus": ("peroneus_brevis",),
}  # fmt: skip
"""Further muscles for which laboratories use an abbreviation."""

_PARTNERS = {"gastrocnemius_medialis": ("gastrocnemius_lateralis", "gastrocnemius")}
"""Muscles whose labels next to an abbreviation show that it is this muscle's."""

_REGION_WORDS = {
    "leg": ("femoris", "vastus", "hamstrings", "quadriceps", "semi", "tibialis", "soleus", "gastrocnemius", "peroneus",
            "gluteus", "adductor",
            "gracilis", "sartorius", "iliopsoas", "tensor", "surae", "digitorum_longus"),
    "trunk": ("abdominis", "oblique", "multifidus", "iliocostalis", "longissimus", "spinae", "latissimus", "trapezius",
              "serratus", "sternocleido", "pectoralis", "infraspinatus"),
}  # fmt: skip
"""Words in the names of muscles of the leg and of the trunk; all others are of the arm."""

MIN_SURE_CONFIDENCE = 0.5
"""A label of less confidence names its muscle only if it is asked for."""


@dataclass(frozen=True)
class MuscleLabel:
    """The muscle that a label names."""

    muscle: str  # Name in the words of study.toml, without its side
    side: str  # "left", "right" or ""
    # 1 for its full name, 0.9 for shortened words, 0.7 for an abbreviation, 0.5 for two letters, 0.3 for what several
    # muscles are called
    confidence: float
    others: tuple[str, ...] = ()  # Further muscles that it may name

    @property
    def name(self) -> str:
        """Name with its side, as study.toml has it."""
        return f"{self.muscle}_{self.side}" if self.side else self.muscle


_DOUBTFUL_LETTERS = frozenset({"pl", "tp", "ad", "ra", "ga", "ut", "ham", "quad"})
"""Abbreviations that name a muscle only with a side or a word for EMG: other channels have these letters too."""

_DOUBTFUL_AFTER_SIDE = frozenset({"st", "so", "sm", "es"})
"""Abbreviations that form other words behind a letter of the side, such as reset and residual."""

_BY_WAY = {way.replace("_", ""): muscle for muscle, ways in MUSCLE_NAMES.items() for way in ways}
_FULL_NAMES = {muscle: tuple(muscle.split("_")) for muscle in MUSCLE_NAMES}


def find_muscle(words: Sequence[str], *, is_emg: bool = False) -> MuscleLabel | None:
    """Return the muscle that the words of a label name, in lower case; None if they name none.

    `is_emg`: whether the channel is known to hold EMG, so that a few letters name no other thing.

    >>> find_muscle(["rt", "vlo"])
    MuscleLabel(muscle='vastus_lateralis', side='right', confidence=0.7, others=())
    >>> find_muscle(["biceps", "fem"]).name
    'biceps_femoris'
    """
    side = side_of_words(words)
    named = [w for w in words if not w.isdigit() and not (side and w in SIDE_WORDS[side])]
    # "rect" shortens rectified, and rectus too.
    with_rect = [w for w in named if w == "rect" or w not in _FILLERS]
    own = with_rect if "".join(with_rect) in _BY_WAY else [w for w in with_rect if w != "rect"]
    joined = "".join(own)
    is_emg = is_emg or bool(side) or bool({"emg", "semg", "hdemg", "uv"} & set(words))
    muscle = _BY_WAY.get(joined)
    if muscle is not None and (is_emg or joined not in _DOUBTFUL_LETTERS):
        return _label(joined, side, 1.0 if len(joined) > 5 else 0.7 if len(joined) > 2 else 0.5)
    if (muscle := _of_short_words(own)) is not None:
        return MuscleLabel(muscle, side, 0.9)
    if (muscle := _of_cut_name(joined)) is not None:
        return MuscleLabel(muscle, side, 0.9)
    # A letter of the side may stand before the name: RVL, LTibAnt.
    for letter, where in (("l", "left"), ("r", "right")):
        rest = joined[1:]
        is_doubtful = rest in _DOUBTFUL_LETTERS | _DOUBTFUL_AFTER_SIDE and not is_emg
        is_known = rest in _BY_WAY and len(rest) > 1 and not is_doubtful
        if not side and len(own) == 1 and joined.startswith(letter) and is_known:
            return _label(rest, where, 0.7 if len(joined) > 6 else 0.5)
    for way, muscle in sorted(_BY_WAY.items(), key=lambda item: -len(item[0])):
        if len(way) > 5 and way in joined:
            return MuscleLabel(muscle, side, 0.7)
    return None


def settle_muscles(labels: Mapping[str, MuscleLabel]) -> dict[str, MuscleLabel]:
    """Return the muscle of each channel of a session, where the other channels tell which of several a label names.

    Labels of less than `MIN_SURE_CONFIDENCE` stay doubtful. `labels` are by the channels' names.

    >>> gm, vl, gl = (find_muscle([word], is_emg=True) for word in ("gm", "vl", "gl"))
    >>> [settle_muscles({"GM": gm, "X": x})["GM"].confidence for x in (vl, gl)]
    [0.3, 0.5]
    """
    sure = {label.muscle for label in labels.values() if not label.others}
    regions = {_region(muscle) for muscle in sure or {label.muscle for label in labels.values()}}
    settled = {}
    for name, label in labels.items():
        near = [m for m in (label.muscle, *label.others) if _region(m) in regions and m not in sure]
        readings = near or [label.muscle]
        if any(partner in sure for partner in _PARTNERS.get(label.muscle, ())):
            readings = [label.muscle]
        if label.others and len(readings) == 1:
            settled[name] = replace(label, muscle=readings[0], others=(), confidence=MIN_SURE_CONFIDENCE)
        else:
            settled[name] = replace(label, muscle=readings[0], others=tuple(readings[1:]))
    return settled


def _region(muscle: str) -> str:
    """Return the part of the body that a muscle belongs to."""
    return next((part for part, words in _REGION_WORDS.items() if any(w in muscle for w in words)), "arm")


def _label(way: str, side: str, confidence: float) -> MuscleLabel:
    """Return the muscle that a spelling names, with a small confidence if it names several."""
    others = _OTHER_READINGS.get(way, ())
    return MuscleLabel(_BY_WAY[way], side, 0.3 if others else confidence, others)


def _of_cut_name(joined: str) -> str | None:
    """Return the only muscle whose full name begins with a label that a format cut off, of at least ten letters."""
    if len(joined) < 10:
        return None
    found = [muscle for muscle in MUSCLE_NAMES if muscle.replace("_", "").startswith(joined)]
    return found[0] if len(found) == 1 else None


def side_of_words(words: Sequence[str]) -> str:
    """Return the side of a body that a word of a label says; "" if none does."""
    return next((side for side, known in SIDE_WORDS.items() if set(known) & set(words)), "")


def _of_short_words(words: Sequence[str]) -> str | None:
    """Return the muscle whose words each begin with one of a label's, of at least three letters."""
    if len(words) < 2 or any(len(word) < 3 for word in words):
        return None
    return next((muscle for muscle, parts in _FULL_NAMES.items() if _begin(words, parts)), None)


def _begin(words: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether each word, or its full form, begins a part of its own, and none is left."""
    left = list(parts)
    for word in words:
        forms = (word, _MODIFIERS.get(word, word))
        part = next((p for p in left if any(p.startswith(f) or f.startswith(p) for f in forms)), None)
        if part is None:
            return False
        left.remove(part)
    return not left
