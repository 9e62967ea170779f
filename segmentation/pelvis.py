"""A CT of the male pelvis to organs: automatic, or led by what a person points at or has drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, part, silent
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.parts import BoneParts, bone_parts
from palpate.segmentation.models.learned import learned_masks
from palpate.segmentation.organs import find_organs
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Found, Scene, make_scene
from palpate.segmentation.whole_scan import WholeScan
from palpate.segmentation.working_grid import Mask, mask_on

# Below this a label wants a person's eye. It is a Dice: what people's own contours of a prostate on CT agree to is 0.8.
DOUBTFUL = 0.7


@dataclass(frozen=True, eq=False)
class Segmentation:
    """scene : the CT as it was worked on. organs : prostate, bladder, rectum where found, masks on the scene's grid."""

    scene: Scene
    organs: Mapping[str, Found] = field(default_factory=dict)

    @cached_property
    def bones(self) -> BoneParts:
        """Femurs, hip bones, sacrum and spine told apart."""
        return bone_parts(self.scene.whole_hu, self.scene.whole_bone, self.scene.pelvis)

    def mask(self, organ: str, grid: Volume) -> Mask:
        """An organ, "bone" or "body" on another grid."""
        if organ == "bone":
            return mask_on(self.scene.whole_bone, grid)
        found = self.scene.body if organ == "body" else self.organs[organ].mask
        return mask_on(self.scene.grid.with_array(found), grid)


def segment_pelvis(
    ct: Volume,
    prompts: Prompts | None = None,
    drawn: Mapping[str, Volume] | None = None,
    progress: Progress = silent,
    model: str | None = None,
    whole: WholeScan | None = None,
    carried: Mapping[str, Callable[[Volume], Found]] | None = None,
) -> Segmentation:
    """Prostate, bladder, rectum and bone of a CT (HU, any grid in patient coordinates).

    prompts : what a person pointed at. drawn : organ -> mask that a person has drawn, which is taken as it is. model : a
    learned model (see learned.py) for organs that nobody has drawn or pointed at. whole : of this CT, where it is known. carried :
    organs that were drawn in another scan, on a grid of this one.

    Raises InputError when the scan holds no body or no pubic bones, no prostate is found, or the model is not there.
    """
    prompts, drawn = prompts or Prompts(), drawn or {}
    learned = learned_masks(ct, model)
    progress(0.0, "body and bone")
    scene = make_scene(ct, prompts, whole=whole)
    given = {name: organ(scene.grid) for name, organ in (carried or {}).items()}
    given |= {name: Found(mask_on(mask, scene.grid), "user", 1.0) for name, mask in drawn.items()}
    organs = find_organs(scene, prompts, given, part(progress, 0.3, 0.6))
    if "prostate" not in organs and "prostate" not in learned:
        raise InputError(
            "no prostate was found in this scan; click on it with --seed prostate=x,y,z (mm, LPS; --deformed-seed in the deformed scan)"
        )
    for name, mask in learned.items():
        if name not in drawn and prompts.mode(name) in ("auto", "carried"):
            organs[name] = _judged(mask_on(mask, scene.grid), str(model).partition(":")[0], organs.get(name))
    progress(1.0, "organs found")
    return Segmentation(scene, organs)


def _judged(mask: Mask, model: str, own: Found | None) -> Found:
    """What a model found, as sure as the picture alone agrees with it (Dice)."""
    total = int(mask.sum()) + (0 if own is None else int(own.mask.sum()))
    agreement = 0.0 if own is None or total == 0 else 2.0 * int((mask & own.mask).sum()) / total
    return Found(mask, model, round(agreement, 3))
