//! Kinds of files that limpid does not read: what they are, and how particles get out of them.

/// Tells the kind of a file with this name, and the remedy.
pub(super) fn remedy(name: &str) -> Option<&'static str> {
    let name = name.to_ascii_lowercase();
    let ends = |extensions: &[&str]| extensions.iter().any(|extension| name.ends_with(extension));
    KINDS.iter().find(|(extensions, _)| ends(extensions)).map(|(_, remedy)| *remedy)
}

const KINDS: &[(&[&str], &str)] = &[
    (&[".sc"], "a Blosc-compressed file of Houdini: only .bgeo.sc can be read"),
    (&[".pvd"], "ParaView's list of files, which is a sequence: give it as the input"),
    (&[".series"], "a list of files, which is a sequence: give it as the input"),
    (&[".ani"], "the ellipsoids of a .pos file: name that, they are read with it"),
    (
        &[".ibi4", ".obi4", ".fbi4", ".mbi4"],
        "a file of DualSPHysics beside its particles: name these, Part_0000.bi4 and so on",
    ),
    (
        &[".abc"],
        "Alembic: convert each frame, as by Blender: `blender -b --python-expr \"import bpy; \
         bpy.ops.wm.read_factory_settings(use_empty=True); \
         bpy.ops.wm.alembic_import(filepath='a.abc', as_background_job=False); \
         bpy.ops.wm.ply_export(filepath='a.ply')\"`",
    ),
    (
        &[".usd", ".usda", ".usdc", ".usdz"],
        "USD: `pip install usd-core numpy`, then `python -c \"import numpy as N; from pxr import \
         Usd, UsdGeom as G; s = Usd.Stage.Open('a.usd'); a = [(G.Xformable(x), \
         x.GetAttribute('points') or x.GetAttribute('positions')) for x in s.Traverse() if \
         'Point' in x.GetTypeName()]; [N.save(f'a_{k}', N.vstack([N.array(p.Get(t)) @ (m := \
         N.array(x.ComputeLocalToWorldTransform(t)))[:3,:3] + m[3,:3] for x, p in a if \
         p.Get(t)])) for k, t in enumerate(sorted({t for _, p in a for t in p.GetTimeSamples()}) \
         or [0])]\"`",
    ),
    (
        &[".xdmf", ".xmf"],
        "XDMF, which describes arrays in another file: name that, if it is HDF5 (.h5), or save the particles in \
         ParaView as .vtu",
    ),
    (
        &[".vdb"],
        "OpenVDB: if it holds points, make them plain ones in Houdini (the node Convert VDB Points) and \
         save them as .bgeo; volumes have no particles",
    ),
    (
        &[".ffp3", ".ffd", ".wwp", ".bobj"],
        "a cache of FLIP Fluids, which only its add-on reads: in Blender, export the object \
         of its fluid particles as .ply",
    ),
    (
        &[".blend"],
        "a scene of Blender: export the particles as .ply, or bake the fluid and name its .uni files",
    ),
    (
        &[".obj", ".stl", ".glb", ".gltf", ".fbx", ".dae", ".3ds", ".off", ".ctm"],
        "a mesh, which is a surface; limpid draws particles: export these, as .ply, .vtk or .bgeo",
    ),
    (
        &[".ptc", ".pdb", ".pda", ".pdc", ".pts", ".ptf", ".mc", ".bin", ".rpc"],
        "particles of a kind that Partio may read: convert them with `partconv a.KIND a.bgeo`",
    ),
    (&[".emp"], "a cache of Naiad: export the particles as .prt or .bgeo"),
    (&[".bif"], "a cache of Bifrost: export the points as .prt or .bgeo"),
    (
        &[".foam"],
        "OpenFOAM's case: write it as VTK with `foamToVTK`, and name the .vtk files of its clouds",
    ),
    (&[".cas", ".msh", ".cgns"], "a mesh of a flow solver, which has no particles"),
    (
        &[".tar", ".tar.gz", ".tgz", ".tar.xz", ".tar.zst", ".zip", ".7z", ".rar"],
        "an archive: unpack it first, and name the files in it",
    ),
    (&[".gz", ".xz", ".zst", ".bz2"], "a compressed file: unpack it first"),
    (
        &[".mat"],
        "MATLAB's: write it as .npz with `python -c \"import numpy, scipy.io; numpy.savez('a.npz', \
         **scipy.io.loadmat('a.mat'))\"`",
    ),
    (
        &[".pkl", ".pickle"],
        "a pickle of Python, which may run any program: save the arrays with `numpy.savez('a.npz', \
         positions=..., velocity=...)`",
    ),
    (
        &[".parquet"],
        "Apache Parquet: write it as .csv with `python -c \"import pandas; \
         pandas.read_parquet('a.parquet').to_csv('a.csv', index=False)\"`",
    ),
    (
        &[".feather", ".arrow"],
        "Apache Arrow: write it as .csv with `python -c \"import pandas; \
         pandas.read_feather('a.feather').to_csv('a.csv', index=False)\"`",
    ),
    (&[".las", ".laz", ".e57", ".pcd"], "a point cloud of a scanner: convert it to .ply"),
];

/// The kind of a file that begins so, in words, if its magic is known.
pub(super) fn known_magic(bytes: &[u8]) -> Option<&'static str> {
    // At least four bytes each, since shorter ones may occur in the first float of an .xyz file.
    const MAGIC: [(&[u8], &str); 27] = [
        (b"\x7fNSJ", "Houdini's new geometry format (call it .bgeo)"),
        (b"scf1", "a Blosc-compressed file of Houdini (call it .bgeo.sc)"),
        (b"BgeoV", "a BGEO file"),
        (b"PGEOMETRY", "Houdini's classic geometry in text (save it as .bgeo)"),
        (b"\x1f\x8b\x08\x00", "gzip data (unpack it first)"),
        (b"\x1f\x8b\x08\x08", "gzip data (unpack it first)"),
        (b"# vtk DataFile", "a legacy VTK file"),
        (b"<?xml", "XML, perhaps VTK's (call it .vtu or .vtp)"),
        (b"<VTKFile", "VTK's XML format (call it .vtu or .vtp)"),
        (b"ply\n", "a PLY file"),
        (b"ply\r\n", "a PLY file"),
        (b"\x93NUMPY", "a NumPy array"),
        (b"PK\x03\x04", "a zip or npz archive (call it .npz if NumPy wrote it)"),
        (b"solid ", "an STL mesh, which holds triangles"),
        (b"\x89HDF", "an HDF5 file (call it .h5)"),
        (b"Ogawa", "an Alembic file"),
        (b"PXR-USDC", "a USD file"),
        (b"#usda", "a USD file"),
        (b"#FileJBD", "a file of DualSPHysics (call it .bi4)"),
        (super::prt::MAGIC, "particles of Krakatoa (call it .prt)"),
        (b"BLENDER", "a scene of Blender"),
        (b"glTF", "a glTF mesh"),
        (b"Kaydara FBX", "an FBX mesh"),
        (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive (unpack it first)"),
        (b"PAR1", "an Apache Parquet file"),
        (b"\x89PNG", "a PNG picture"),
        (b"\x76\x2f\x31\x01", "an OpenEXR picture"),
    ];
    if stl_length(bytes) == Some(bytes.len() as u64) {
        return Some("a binary STL mesh, which holds triangles");
    }
    MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, kind)| kind)
}

/// The length of a file with this start if it is binary STL, which has no magic, but a length
/// determined by its number of triangles.
pub(super) fn stl_length(start: &[u8]) -> Option<u64> {
    let triangles = start.get(80..)?.first_chunk().map(|&count| u32::from_le_bytes(count))?;
    Some(84 + 50 * u64::from(triangles))
}
