"""USD stages in usd-core: structure and numbers, no simulation."""

import math

from pxr import Sdf, Usd, UsdGeom, UsdPhysics, UsdUtils

from .report import collect_warnings


def check_usd(path, _states, report):
    """Opens a stage and checks the properties that importers need."""
    with collect_warnings(report):
        stage = Usd.Stage.Open(path)
        prims = list(stage.Traverse())
    root = stage.GetDefaultPrim()
    report.add("-", "default prim", root.IsValid(), note=root.GetName() if root.IsValid() else "none")
    scale = UsdGeom.GetStageMetersPerUnit(stage)
    authored = stage.HasAuthoredMetadata(UsdGeom.Tokens.metersPerUnit)
    report.add("-", "metersPerUnit", authored and scale > 0, scale, "m")
    axis = UsdGeom.GetStageUpAxis(stage)
    authored = stage.HasAuthoredMetadata(UsdGeom.Tokens.upAxis)
    report.add("-", "upAxis", authored and axis == UsdGeom.Tokens.z, note=str(axis))
    roots = [p for p in prims if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    joints = [p for p in prims if p.IsA(UsdPhysics.RevoluteJoint) or p.IsA(UsdPhysics.PrismaticJoint)]
    if joints or path.endswith("usda"):
        report.add("-", "one articulation root", len(roots) == 1, len(roots), "roots")
    for prim in joints:
        _joint(prim, report)
    _bodies(prims, report)
    _meshes(prims, report)
    _assets(path, report)


def check_scene(path, _states, report):
    """Opens the scene and looks for the object in it."""
    with collect_warnings(report):
        stage = Usd.Stage.Open(path)
        prims = list(stage.Traverse())
    root = stage.GetDefaultPrim()
    bodies = [p for p in prims if p.HasAPI(UsdPhysics.RigidBodyAPI) and p.GetPath().HasPrefix(root.GetPath())]
    report.add("-", "object in the scene", len(bodies) > 0, len(bodies), "bodies")
    cameras = [p for p in prims if p.IsA(UsdGeom.Camera)]
    report.add("-", "camera", len(cameras) == 1, len(cameras), "cameras")
    scenes = [p for p in prims if p.IsA(UsdPhysics.Scene)]
    report.add("-", "one physics scene", len(scenes) == 1, len(scenes), "scenes")
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    objects = [p for p in root.GetChildren() if p.IsA(UsdGeom.Xform)]
    lowest = min(box.ComputeWorldBound(p).ComputeAlignedRange().GetMin()[2] for p in objects)
    report.add("-", "stands on the floor", abs(lowest) < 5e-3, lowest, "m")


def check_variants(path, states, report):
    """Opens the stage of a SimReady folder and every option of its variant sets, one at a time."""
    check_usd(path, states, report)
    stage = Usd.Stage.Open(path)
    sets = stage.GetDefaultPrim().GetVariantSets()
    defaults = {name: sets.GetVariantSelection(name) for name in sets.GetNames()}
    report.add("-", "has variants", bool(defaults), len(defaults), "variant sets", " ".join(defaults))
    plain = _drawn_box(stage)
    for name in defaults:
        for option in sets.GetVariantSet(name).GetVariantNames():
            with collect_warnings(report):
                chosen = Usd.Stage.Open(path, load=Usd.Stage.LoadAll)
                chosen.SetEditTarget(chosen.GetSessionLayer())
                chosen.GetDefaultPrim().GetVariantSet(name).SetVariantSelection(option)
                prims = list(chosen.Traverse())
            # A prim that only has opinions, and no definition, would be an opinion about nothing.
            bare = [str(p.GetPath()) for p in chosen.TraverseAll() if not p.IsDefined()]
            report.add(name, f"{option} composes", not bare, len(prims), "prims", " ".join(bare[:3]))
            box = _drawn_box(chosen)
            apart = max((abs(a - b) for a, b in zip(plain, box)), default=0.0)
            # Gaussians reach beyond the surface that they show, the less the better they are trained.
            same = None if option == "GaussianSplat" else apart < 1e-6
            report.add(name, f"{option}: box of what is drawn differs", same, apart, "m")


def _drawn_box(stage):
    """Sides of the box around what is drawn."""
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render]
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), purposes).ComputeWorldBound(stage.GetDefaultPrim())
    return list(box.ComputeAlignedRange().GetSize())


def _joint(prim, report):
    joint = UsdPhysics.RevoluteJoint(prim) if prim.IsA(UsdPhysics.RevoluteJoint) else UsdPhysics.PrismaticJoint(prim)
    name = prim.GetName()
    lower, upper = joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get()
    finite = all(v is not None and math.isfinite(v) for v in (lower, upper))
    report.add(name, "limits", finite and lower < upper, note=f"{lower} to {upper}")
    report.add(name, "axis", joint.GetAxisAttr().Get() in ("X", "Y", "Z"), note=str(joint.GetAxisAttr().Get()))
    base = UsdPhysics.Joint(prim)
    targets = base.GetBody0Rel().GetTargets() + base.GetBody1Rel().GetTargets()
    stage = prim.GetStage()
    sound = len(targets) == 2 and all(stage.GetPrimAtPath(t).HasAPI(UsdPhysics.RigidBodyAPI) for t in targets)
    report.add(name, "joins two bodies", sound, note=" ".join(map(str, targets)))
    for label, attribute in (("localRot0", base.GetLocalRot0Attr()), ("localRot1", base.GetLocalRot1Attr())):
        turn = attribute.Get()
        length = math.sqrt(turn.GetReal() ** 2 + turn.GetImaginary().GetLength() ** 2)
        report.add(name, f"{label} is a rotation", abs(length - 1.0) < 1e-4, length)


def _bodies(prims, report):
    for prim in (p for p in prims if p.HasAPI(UsdPhysics.RigidBodyAPI)):
        name, parent = prim.GetName(), prim.GetParent()
        while parent and not parent.HasAPI(UsdPhysics.RigidBodyAPI):
            parent = parent.GetParent()
        report.add(name, "body not in a body", not parent, note=str(parent.GetPath()) if parent else "")
        mass = UsdPhysics.MassAPI(prim)
        kilograms, inertia = mass.GetMassAttr().Get(), mass.GetDiagonalInertiaAttr().Get()
        report.add(name, "mass", prim.HasAPI(UsdPhysics.MassAPI) and kilograms > 0, kilograms, "kg")
        moments = sorted(inertia or (0, 0, 0))
        sane = moments[0] > 0 and moments[0] + moments[1] >= moments[2] * (1 - 1e-5)
        report.add(name, "inertia", sane, note=" ".join(f"{v:.3g}" for v in moments))


def _meshes(prims, report):
    meshes = [p for p in prims if p.IsA(UsdGeom.Mesh)]
    report.add("-", "has meshes", bool(meshes), len(meshes), "meshes")
    for prim in meshes:
        mesh = UsdGeom.Mesh(prim)
        points, counts = mesh.GetPointsAttr().Get() or [], mesh.GetFaceVertexCountsAttr().Get() or []
        indices = mesh.GetFaceVertexIndicesAttr().Get() or []
        faults = []
        if sum(counts) != len(indices):
            faults.append(f"{sum(counts)} corners, {len(indices)} indices")
        if len(indices) and (min(indices) < 0 or max(indices) >= len(points)):
            faults.append(f"index beyond {len(points)} points")
        if any(not math.isfinite(c) for p in points for c in p):
            faults.append("points not finite")
        for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvars():
            size = len(primvar.ComputeFlattened() or [])
            expected = {
                "vertex": len(points),
                "varying": len(points),
                "faceVarying": len(indices),
                "uniform": len(counts),
                "constant": size,
            }.get(primvar.GetInterpolation())
            if size != expected:
                faults.append(f"{primvar.GetName()}: {size} values, {expected} needed")
        # One line counts all valid meshes; invalid ones are named.
        if faults or not len(points):
            report.add(str(prim.GetPath()), "mesh", False, note="; ".join(faults) or "no points")


def _assets(path, report):
    _, _, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(path))
    report.add("-", "all files found", not missing, note=" ".join(missing))
