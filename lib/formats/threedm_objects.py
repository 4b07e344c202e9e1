"""What a Rhino file shows: its objects, and those of its blocks once for each reference, by layer and material."""

from dataclasses import dataclass

import numpy as np

DEEPEST = 50  # blocks in blocks; deeper ones go round in circles


@dataclass(frozen=True)
class Shown:
    """One visible object.

    geometry : of rhino3dm;  id : of the object, the same for every reference to its block
    layer : full path of its layer;  labels : what `only` may match: layer, name, those of the references it is in
    material : index of its material or None;  M : (4, 4) its place, or None where it stands as it is
    """

    geometry: object
    id: str
    layer: str
    labels: tuple
    material: int | None
    M: np.ndarray | None = None


def shown(model, materials, skipped):
    """Yield every visible object (Shown) in the order of the file; `skipped` counts hidden ones by their kind."""
    walk = _Walk(model, materials, skipped)
    for item in model.Objects:
        if not item.Attributes.IsInstanceDefinitionObject:
            yield from walk.objects(item)


class _Walk:
    def __init__(self, model, materials, skipped):
        self.model, self.materials, self.skipped, self.layers = model, materials, skipped, _Layers(model)

    def objects(self, item, M=None, labels=(), parent=None, depth=0):
        """The object itself, or what a block reference shows, `depth` references deep at the place M."""
        attributes, geometry = item.Attributes, item.Geometry
        if geometry is None:
            return
        if not attributes.Visible or attributes.Mode.name == "Hidden":
            self.skipped["hidden object"] += 1
            return
        if not self.layers.is_visible(attributes.LayerIndex):
            self.skipped["object on a hidden layer"] += 1
            return
        layer = self.layers.by_index.get(attributes.LayerIndex)
        material = self.materials.index(attributes, layer, parent)
        own = (*self.layers.names(attributes.LayerIndex), *([attributes.Name] if attributes.Name else []), *labels)
        if type(geometry).__name__ != "InstanceReference":
            yield Shown(geometry, str(attributes.Id), own[0] if own else "", tuple(dict.fromkeys(own)), material, M)
            return
        definition = self.model.InstanceDefinitions.FindId(geometry.ParentIdefId)
        if definition is None or depth >= DEEPEST:
            self.skipped["block reference without a definition"] += 1
            return
        place = np.array(geometry.Xform.ToFloatArray(True)).reshape(4, 4)
        place = place if M is None else M @ place
        for number in definition.GetObjectIds():
            part = self.model.Objects.FindId(str(number))
            if part is not None:
                yield from self.objects(part, place, (*own, definition.Name), material, depth + 1)


class _Layers:
    """Layers of a model by index: a layer shows if it and everything above it does."""

    def __init__(self, model):
        self.by_index = {layer.Index: layer for layer in model.Layers}
        self.by_id = {layer.Id: layer for layer in model.Layers}

    def is_visible(self, index):
        layer, steps = self.by_index.get(index), 0
        while layer is not None and steps < 100:
            if not layer.Visible:
                return False
            layer, steps = self.by_id.get(layer.ParentLayerId), steps + 1
        return True

    def names(self, index):
        layer = self.by_index.get(index)
        return () if layer is None else tuple(dict.fromkeys((layer.FullPath, layer.Name)))
