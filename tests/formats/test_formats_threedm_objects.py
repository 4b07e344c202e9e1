"""Blocks, meshes, lights, materials and textures of Rhino files."""

from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from lib.nurbs.evaluate import frame
from lib.surfaces.mesh import Mesh
from tests.formats.reading import read, refused

DATA = Path(__file__).parents[1] / "data"
MIDDLE = np.array([0.5])


def model(unit=rhino3dm.UnitSystem.Meters):
    made = rhino3dm.File3dm()
    made.Settings.ModelUnitSystem = unit
    return made


def written(made, path):
    made.Write(str(path), 7)
    return path


def sheet(x=0.0):
    """The square [x, x + 1] x [0, 1] in z = 0, lit from above."""
    low, high = (rhino3dm.LineCurve(rhino3dm.Point3d(x, y, 0), rhino3dm.Point3d(x + 1, y, 0)) for y in (0, 1))
    return rhino3dm.NurbsSurface.CreateRuledSurface(low, high)


def test_the_example_file_shows_its_blocks_once_for_each_reference():
    content = read(DATA / "v4_example_file.3dm")
    kinds = [type(patch.surface).__name__ for patch in content.patches]
    assert (kinds.count("Mesh"), kinds.count("NurbsSurface")) == (2, 12)
    assert content.notes[0] == (
        "skipped: 7 curves, 4 dimensions, 1 hatch, 3 points, 1 point cloud, 1 point light, 1 spot light, 2 texts"
    )
    meshes = [patch.surface for patch in content.patches if isinstance(patch.surface, Mesh)]
    assert sum(len(mesh.F) for mesh in meshes) >= 196 - 40 and all(mesh.T is not None for mesh in meshes)
    # A sphere and, in a block of its own, another body: two references to the outer block show each of them twice
    middle = [
        patch.surface.P.reshape(-1, 3).mean(axis=0)
        for patch in content.patches
        if "Block 02" in patch.labels and "Block 01" not in patch.labels
    ]
    assert len(middle) == 2
    step = np.array([38.13064193725586 + 9.444286346435547, 60.931400299072266 - 61.76119613647461, 0.0])
    assert middle[1] - middle[0] == pytest.approx(step, abs=1e-9)
    nested = [patch for patch in content.patches if "Block 01" in patch.labels]
    assert len(nested) == 2 and all("IRefs" in patch.labels for patch in nested)


def lit(patch):
    """Middle and lit direction of a NURBS patch."""
    S, N = frame(patch.surface, MIDDLE, MIDDLE)
    return S[0], N[0] * (-1 if patch.flip else 1)


def test_a_mirrored_reference_keeps_the_lit_side_of_the_object(tmp_path):
    made = model()
    number = made.InstanceDefinitions.Add(
        "tile", "", "", "", rhino3dm.Point3d(0, 0, 0), (sheet(),), (rhino3dm.ObjectAttributes(),)
    )
    identity = made.InstanceDefinitions.FindIndex(number).Id
    mirror = rhino3dm.Transform(1.0)
    mirror.M00, mirror.M03 = -2.0, 5.0
    for place in (rhino3dm.Transform(1.0), mirror):
        made.Objects.AddInstanceObject(rhino3dm.InstanceReference(identity, place))
    plain, turned = read(written(made, tmp_path / "a.3dm")).patches
    assert lit(plain)[1] == pytest.approx([0, 0, 1]) and lit(turned)[1] == pytest.approx([0, 0, 1])
    assert lit(turned)[0] == pytest.approx([4, 0.5, 0])
    assert (plain.flip, turned.flip) == (False, True)
    assert "tile" in turned.labels


def test_a_mesh_keeps_its_triangles_and_normals(tmp_path):
    made, mesh = model(), rhino3dm.Mesh()
    for x, y in ((0, 0), (2, 0), (2, 1), (0, 1), (3, 0.5)):
        mesh.Vertices.Add(x, y, 0)
    mesh.Faces.AddFace(0, 1, 2, 3)
    mesh.Faces.AddFace(1, 4, 2)
    mesh.Normals.ComputeNormals()
    made.Objects.AddMesh(mesh)
    [patch] = read(written(made, tmp_path / "a.3dm")).patches
    assert patch.solid is False and len(patch.surface.F) == 3
    assert patch.surface.T is None
    assert np.abs(patch.surface.N - [0, 0, 1]).max() == 0


def test_meshes_with_colours_and_without_an_area_are_named(tmp_path):
    made = model()
    for height, has_colours in ((1.0, True), (0.0, True), (2.0, False)):
        mesh = rhino3dm.Mesh()
        for x, y in ((0, 0), (2, 0), (2, height)):
            mesh.Vertices.Add(x, y, 0)
            if has_colours:
                mesh.VertexColors.Add(255, 128, 0)
        mesh.Faces.AddFace(0, 1, 2)
        made.Objects.AddMesh(mesh)
    content = read(written(made, tmp_path / "a.3dm"))
    assert [patch.number for patch in content.patches] == [1, 3] and content.total == 3
    assert content.notes == ["meshes without an area are left out: part/2", "vertex colours are not used: part/1"]
    assert refused(tmp_path / "a.3dm", only="2").startswith("a.3dm: no mesh has an area")


def lamp(style, **fields):
    light = rhino3dm.Light()
    light.LightStyle, light.Location = style, rhino3dm.Point3d(0, 0, 3)
    light.Length, light.Width = rhino3dm.Vector3d(2, 0, 0), rhino3dm.Vector3d(0, 1, 0)
    light.Direction = rhino3dm.Vector3d(0, 0, -1)
    for key, value in fields.items():
        setattr(light, key, value)
    return light


def test_rectangular_lights_become_patches_that_emit(tmp_path):
    made, style = model(rhino3dm.UnitSystem.Centimeters), rhino3dm.LightStyle
    made.Objects.AddSurface(sheet())
    dim = lamp(style.WorldRectangular, Name="lamp", Diffuse=(255, 255, 255, 255), Intensity=0.5)
    watts = lamp(style.WorldRectangular, Name="lamp", Diffuse=(255, 0, 0, 255), PowerWatts=60.0)
    off = lamp(style.WorldRectangular, IsEnabled=False)
    for light in (dim, watts, off, lamp(style.WorldPoint), lamp(style.WorldDirectional), lamp(style.WorldLinear)):
        made.Objects.Add(light)
    content = read(written(made, tmp_path / "a.3dm"))
    assert content.notes == ["skipped: 1 directional light, 1 light that is off, 1 linear light, 1 point light"]
    _, first, second = content.patches
    S, N = lit(first)
    assert S == pytest.approx([1, 0.5, 3]) and N == pytest.approx([0, 0, -1])
    assert (first.material, second.material) == ("lamp", "lamp (2)")
    assert content.materials["lamp"]["emission"] == pytest.approx([np.pi / 2] * 3)
    red = content.materials["lamp (2)"]["emission"]
    assert red[1:] == [0, 0] and 0.2126 * red[0] * 2e-4 == pytest.approx(60)  # 2 x 1 cm


def test_materials_come_from_object_layer_and_parent_and_are_linear(tmp_path):
    made = model()
    for name, colour in (("red", (255, 0, 0, 255)), ("grey", (188, 188, 188, 255)), ("grey", (255, 255, 255, 255))):
        material = rhino3dm.Material()
        material.Name, material.DiffuseColor = name, colour
        made.Materials.Add(material)
    glow = rhino3dm.Material()
    glow.DiffuseColor, glow.EmissionColor, glow.Transparency = (0, 0, 0, 255), (255, 255, 0, 255), 0.5
    made.Materials.Add(glow)
    layer = rhino3dm.Layer()
    layer.Name, layer.RenderMaterialIndex = "walls", 1
    made.Layers.Add(layer)
    source = rhino3dm.ObjectMaterialSource
    wanted = [(source.MaterialFromLayer, -1), (source.MaterialFromObject, 2), (source.MaterialFromObject, 3)]
    for step, (kind, index) in enumerate(wanted):
        attributes = rhino3dm.ObjectAttributes()
        attributes.MaterialSource, attributes.MaterialIndex, attributes.LayerIndex = kind, index, 0
        made.Objects.Add(sheet(2 * step), attributes)
    inner, outer = rhino3dm.ObjectAttributes(), rhino3dm.ObjectAttributes()
    inner.MaterialSource = source.MaterialFromParent
    outer.MaterialSource, outer.MaterialIndex = source.MaterialFromObject, 0
    number = made.InstanceDefinitions.Add("b", "", "", "", rhino3dm.Point3d(0, 0, 0), (sheet(9),), (inner,))
    identity = made.InstanceDefinitions.FindIndex(number).Id
    made.Objects.Add(rhino3dm.InstanceReference(identity, rhino3dm.Transform(1.0)), outer)
    content = read(written(made, tmp_path / "a.3dm"))
    assert [patch.material for patch in content.patches] == ["grey", "grey (2)", "material 4", "red"]
    assert content.materials["grey"]["reflectance"] == pytest.approx([0.5029] * 3, abs=1e-4)
    assert content.materials["grey (2)"]["reflectance"] == [1, 1, 1]
    assert content.materials["red"]["reflectance"] == [1, 0, 0]
    assert content.materials["material 4"]["emission"] == pytest.approx([np.pi, np.pi, 0])
    assert content.notes == ["materials that let light through, opaque here: material 4"]


def test_a_faint_glow_is_no_light(tmp_path):
    made = model()
    for number, level in enumerate((40, 70)):  # of 255: 0.021 and 0.061 of white
        glow = rhino3dm.Material()
        glow.Name, glow.EmissionColor = f"glass {number}", (level, level, level, 255)
        made.Materials.Add(glow)
        attributes = rhino3dm.ObjectAttributes()
        attributes.MaterialSource, attributes.MaterialIndex = rhino3dm.ObjectMaterialSource.MaterialFromObject, number
        made.Objects.Add(sheet(2 * number), attributes)
    content = read(written(made, tmp_path / "a.3dm"))
    assert "emission" not in content.materials["glass 0"]
    assert content.materials["glass 1"]["emission"] == pytest.approx([0.0612 * np.pi] * 3, rel=1e-2)
    assert content.notes == ["materials with a faint glow, which gives no light here: glass 0"]


def textured(path, *names, embed=None):
    """A file with one sheet for each bitmap name."""
    made = model()
    for step, name in enumerate(names):
        material = rhino3dm.Material()
        material.Name = f"m{step}"
        material.SetBitmapTexture(name)
        made.Materials.Add(material)
        attributes = rhino3dm.ObjectAttributes()
        attributes.MaterialSource, attributes.MaterialIndex = rhino3dm.ObjectMaterialSource.MaterialFromObject, step
        made.Objects.Add(sheet(2 * step), attributes)
    if embed:
        made.EmbeddedFiles.Add(rhino3dm.EmbeddedFile.Read(str(embed)))
    return written(made, path)


def test_textures_are_found_by_their_bare_name_in_any_case(tmp_path):
    folder = tmp_path / "scene" / "models"
    folder.mkdir(parents=True)
    (folder / "atoz.BMP").write_bytes(b"BM")
    (tmp_path / "scene" / "wood.png").write_bytes(b"PNG")
    (tmp_path / "secret.png").write_bytes(b"PNG")
    (folder / "lfs.png").write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    names = ("C:\\Users\\x\\AtoZ.bmp", "/home/y/wood.png", "AtoZ.jpg", "../../secret.png", "lfs.png")
    content = read(textured(folder / "a.3dm", *names), root=tmp_path / "scene")
    found = {key: material.get("texture") for key, material in content.materials.items()}
    assert found == {"m0": "atoz.BMP", "m1": "../wood.png", "m2": None, "m3": None, "m4": None}
    assert "reflectance" in content.materials["m2"]
    [note] = content.notes
    assert "AtoZ.jpg, secret.png (no such file)" in note and "lfs.png (a Git LFS pointer" in note


def test_a_picture_in_the_file_is_used_where_none_lies_beside_it(tmp_path):
    (tmp_path / "away").mkdir()
    (tmp_path / "away" / "pic.png").write_bytes(b"picture")
    content = read(textured(tmp_path / "a.3dm", "/x/PIC.png", embed=tmp_path / "away" / "pic.png"))
    assert content.materials["m0"] == {"texture": "embedded:PIC.png"}
    assert content.pictures == {"PIC.png": b"picture"} and content.notes == []


def test_textures_that_the_extrusions_name(tmp_path):
    path = tmp_path / "v5_extrusions.3dm"
    path.write_bytes((DATA / path.name).read_bytes())
    (tmp_path / "AtoZ.bmp").write_bytes(b"BM")
    content = read(path, trimmed="skip")
    assert sum("texture" in material for material in content.materials.values()) == 3
    assert len(content.materials) == 7
    assert content.notes[1].endswith("AtoZ.jpg (no such file)")


def test_a_subd_is_named(tmp_path):
    made = model()
    made.Objects.AddSurface(sheet())
    made.Objects.Add(rhino3dm.SubD(), rhino3dm.ObjectAttributes())
    assert read(written(made, tmp_path / "a.3dm")).notes == ["skipped: 1 SubD"]
