"""Run by an interpreter that has compas_cra: one of its published samples, its verdict, time and contacts as JSON."""

import json
import os
import sys
import time
from contextlib import redirect_stdout
from pathlib import Path

import compas
import compas_cra
from compas_cra.algorithms import assembly_interfaces_numpy
from compas_cra.datastructures import CRA_Assembly
from compas_cra.equilibrium import cra_solve, density_setup

request = json.load(sys.stdin)
path = Path(compas_cra.__file__).parent / "data" / "samples" / f"{request['sample']}.json"
with redirect_stdout(open(os.devnull, "w", encoding="utf-8")):
    assembly = compas.json_load(path).copy(cls=CRA_Assembly)
    assembly.set_boundary_conditions(request["fixed"])
    if request["heavy"]:
        density_setup(assembly, {n: request["heavy"].get(str(n), 1.0) for n in assembly.graph.nodes()})
    if request["detect"]:
        assembly_interfaces_numpy(assembly, **request["detect"])
    assembly.rotate_assembly([0, 0, 0], request["axis"], request["deg"])
    nodes = list(assembly.graph.nodes())
    blocks = [assembly.node_block(n) for n in nodes]
    weights = [b.volume() * request["heavy"].get(str(n), 1.0) for n, b in zip(nodes, blocks)]
    centres = [list(b.center()) for b in blocks]
    pairs, points, normals = [], [], []
    for edge in assembly.graph.edges():
        for interface in assembly.graph.edge_attribute(edge, "interfaces"):
            for point in interface.points:
                pairs.append([nodes.index(edge[0]), nodes.index(edge[1])])
                points.append(list(point))
                normals.append(list(interface.frame.zaxis))
    begin = time.process_time()
    try:
        cra_solve(assembly, mu=request["friction"], density=request["density"], **request["options"])
        verdict = "stands"
    except Exception as error:
        verdict = f"no answer ({str(error)[:60]})"
    seconds = time.process_time() - begin
print(
    json.dumps(
        {
            "seconds": seconds,
            "verdict": verdict,
            "pairs": pairs,
            "points": points,
            "normals": normals,
            "centres": centres,
            "weights": weights,
            "fixed": [nodes.index(n) for n in request["fixed"]],
        }
    )
)
