//! What kind of file a mesh is, by its first bytes; and for kinds that are not read, the way to
//! convert them.

/// A kind of mesh file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    Obj,
    Stl,
    Ply,
    Other(&'static Other),
}

/// What files of a kind may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Holds {
    /// A mesh with joints.
    Body,
    /// A mesh.
    Mesh,
    /// Something else.
    Other,
}

/// A kind that is not read.
#[derive(Debug)]
pub(super) struct Other {
    /// The kind, as in "the file is …".
    name: &'static str,
    is: fn(&Start) -> bool,
    holds: Holds,
    /// What to do.
    advice: &'static str,
}

impl Other {
    /// The error where a mesh is expected.
    pub(super) fn as_mesh(&self) -> String {
        format!("the file is {}, which is not read as a mesh: {}", self.name, self.advice)
    }

    /// The error where an armature is expected.
    fn as_armature(&self) -> String {
        let Other { name, advice, .. } = self;
        let then = match self.holds {
            Holds::Mesh => ", read that with mesh(…) and rig it with scene.autorig",
            Holds::Body | Holds::Other => "",
        };
        format!("the file is {name}, which is not read as an armature: {advice}{then}")
    }
}

/// The error for a file that is neither glTF nor JSON where an armature is expected; `None` for
/// what may be a rig.
pub fn not_an_armature(file: &str, bytes: &[u8]) -> Option<String> {
    let name = match kind(file, bytes) {
        Kind::Obj => "an OBJ",
        Kind::Stl => "an STL",
        Kind::Ply => "a PLY",
        Kind::Other(other) if std::ptr::eq(other, JSON) => return None,
        Kind::Other(other) => return Some(other.as_armature()),
    };
    Some(format!(
        "{name} file has no joints; read it with mesh(…) and rig it with scene.autorig, or give a \
         glTF file with a skin"
    ))
}

/// The start of a file.
struct Start<'a> {
    bytes: &'a [u8],
    /// The first kilobytes without leading space, as text in lower case.
    text: String,
}

impl Start<'_> {
    fn is(&self, start: &[u8]) -> bool {
        self.bytes.starts_with(start)
    }

    /// Whether the text starts with this, in lower case.
    fn says(&self, start: &str) -> bool {
        self.text.starts_with(start)
    }

    /// Whether the file is XML with this element near its start.
    fn xml(&self, element: &str) -> bool {
        self.says("<") && self.text.contains(element)
    }

    /// Whether the file is a ZIP archive whose first member has this in its name.
    fn zip(&self, part: &str) -> bool {
        let length =
            self.bytes.get(26..28).map_or(0, |b| usize::from(b[0]) + 256 * usize::from(b[1]));
        let name = self.bytes.get(30..30 + length).unwrap_or_default();
        self.is(b"PK\x03\x04") && String::from_utf8_lossy(name).to_lowercase().contains(part)
    }

    /// Whether the file is a ZIP archive that lists a member of this name.
    fn lists(&self, name: &[u8]) -> bool {
        let end = &self.bytes[self.bytes.len().saturating_sub(1 << 16)..];
        self.is(b"PK\x03\x04") && end.windows(name.len()).any(|w| w == name)
    }
}

const BLENDER: &str = "open it in Blender and export glTF 2.0 (.glb)";
const CAD: &str = "export STL from FreeCAD, or run `gmsh FILE -2 -o FILE.stl` (and give `unit = 0.001` \
                   for millimetres)";
const TRIMESH: &str =
    "convert it, such as by `trimesh.load_mesh(\"FILE\").export(\"FILE.ply\")` in Python";
const ASSIMP: &str = "convert it by `assimp export FILE FILE.glb`";
const PICTURE: &str =
    "read it with image(…), mask(…) or depth(…); a mesh is a glTF, OBJ, STL or PLY file";

/// JSON that is not glTF.
const JSON: &Other = &KINDS[0];

#[rustfmt::skip]
static KINDS: &[Other] = &[
    Other { name: "JSON, but not glTF", holds: Holds::Other, is: |s| s.says("{") || s.says("["),
        advice: "a rig is read with armature(…), joints with keypoints(…), other data with json(…)" },
    Other { name: "FBX", holds: Holds::Body, is: |s| s.is(b"Kaydara FBX Binary") || s.says("; fbx"),
        advice: "open it in Blender and export glTF 2.0 (.glb), or run `assimp export FILE FILE.glb`" },
    Other { name: "USD", holds: Holds::Body,
        is: |s| s.is(b"PXR-USDC") || s.says("#usda") || s.zip(".usd"), advice: BLENDER },
    Other { name: "a Blender file", holds: Holds::Body, is: |s| s.is(b"BLENDER"), advice: BLENDER },
    Other { name: "compressed (Zstandard), perhaps a Blender file", holds: Holds::Body,
        is: |s| s.is(b"\x28\xb5\x2f\xfd"), advice: BLENDER },
    Other { name: "COLLADA (DAE)", holds: Holds::Body, is: |s| s.xml("<collada"), advice: ASSIMP },
    Other { name: "Alembic", holds: Holds::Mesh, is: |s| s.is(b"Ogawa"), advice: BLENDER },
    Other { name: "STEP (CAD)", holds: Holds::Mesh, is: |s| s.says("iso-10303-21"), advice: CAD },
    Other { name: "IGES (CAD)", holds: Holds::Mesh,
        is: |s| s.bytes.get(72..80) == Some(b"S      1") || s.bytes.get(72..80) == Some(b"S0000001"), advice: CAD },
    Other { name: "OpenCASCADE's BRep (CAD)", holds: Holds::Mesh,
        is: |s| s.says("dbrep_drawableshape") || s.says("cascade topology"), advice: CAD },
    Other { name: "DXF (CAD)", holds: Holds::Mesh, is: |s| s.says("0\nsection") || s.says("0\r\nsection") || s.says("999\n") || s.says("999\r\n") || s.is(b"AutoCAD Binary DXF"),
        advice: CAD },
    Other { name: "Rhino's 3DM (CAD)", holds: Holds::Mesh, is: |s| s.is(b"3D Geometry File Format"),
        advice: "export OBJ or STL from Rhino" },
    Other { name: "3MF", holds: Holds::Mesh, is: |s| s.lists(b"3D/3dmodel.model"), advice: TRIMESH },
    Other { name: "AMF", holds: Holds::Mesh, is: |s| s.xml("<amf"), advice: "export STL or 3MF from the program that made it" },
    Other { name: "OFF", holds: Holds::Mesh,
        is: |s| s.text.split_whitespace().next().and_then(|w| w.strip_suffix("off"))
            .is_some_and(|kind| kind.bytes().all(|b| b"stcn4".contains(&b))),
        advice: TRIMESH },
    Other { name: "3DS", holds: Holds::Mesh,
        is: |s| s.is(b"MM") && s.bytes.get(2..6).is_some_and(|b| {
            let length = b.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
            (6..=s.bytes.len()).contains(&length)
        }),
        advice: ASSIMP },
    Other { name: "X3D", holds: Holds::Mesh, is: |s| s.xml("<x3d"), advice: ASSIMP },
    Other { name: "VRML", holds: Holds::Mesh, is: |s| s.says("#vrml") || s.says("#x3d"), advice: "open it in MeshLab and export PLY or OBJ" },
    Other { name: "VTK", holds: Holds::Mesh, is: |s| s.says("# vtk") || s.xml("<vtkfile"),
        advice: "convert it by `meshio convert FILE FILE.ply`" },
    Other { name: "Gmsh's MSH", holds: Holds::Mesh, is: |s| s.says("$meshformat"), advice: "convert it by `gmsh FILE -2 -o FILE.stl`" },
    Other { name: "a PCD cloud of points", holds: Holds::Other, is: |s| s.says("# .pcd") || s.says("version .7"),
        advice: "make a surface of it first, such as with Open3D's Poisson reconstruction" },
    Other { name: "a LAS cloud of points", holds: Holds::Other, is: |s| s.is(b"LASF"),
        advice: "make a surface of it first, such as with CloudCompare or MeshLab" },
    Other { name: "BVH, a motion without a mesh", holds: Holds::Body, is: |s| s.says("hierarchy"),
        advice: "open it in Blender with the character that it moves, and export glTF 2.0 (.glb)" },
    Other { name: "a Maya scene", holds: Holds::Body, is: |s| s.says("//maya ascii"), advice: "export FBX or USD from Maya, and glTF from Blender" },
    Other { name: "a model of MikuMikuDance", holds: Holds::Body, is: |s| s.is(b"PMX ") || s.is(b"Pmd"),
        advice: "import it into Blender (add-on MMD Tools) and export glTF 2.0 (.glb)" },
    Other { name: "a Python pickle, perhaps of SMPL", holds: Holds::Body, is: |s| s.bytes.first() == Some(&0x80) && s.bytes.get(1).is_some_and(|v| (2..=5).contains(v)),
        advice: "make it glTF with Blender's SMPL add-on, or a rig file from its arrays (docs/howto/bodies.md)" },
    Other { name: "an archive of NumPy arrays, perhaps SMPL", holds: Holds::Body, is: |s| s.zip(".npy"),
        advice: "make it glTF with Blender's SMPL add-on, or a rig file from its arrays (docs/howto/bodies.md)" },
    Other { name: "a NumPy array", holds: Holds::Other, is: |s| s.is(b"\x93NUMPY"), advice: "read it with depth(…) or mask(…)" },
    Other { name: "HDF5", holds: Holds::Other, is: |s| s.is(b"\x89HDF"), advice: "write its vertices and faces as PLY" },
    Other { name: "MATLAB data", holds: Holds::Other, is: |s| s.is(b"MATLAB 5.0"), advice: "write its vertices and faces as PLY" },
    Other { name: "a picture", holds: Holds::Other, is: |s| image::guess_format(s.bytes).is_ok() || s.xml("<svg"), advice: PICTURE },
    Other { name: "an OBJ file's materials (MTL)", holds: Holds::Other, is: |s| s.says("newmtl"), advice: "give the `.obj` file beside it" },
    Other { name: "a web page", holds: Holds::Other, is: |s| s.says("<!doctype html") || s.says("<html"),
        advice: "download the file itself, not its page" },
    Other { name: "a pointer of Git LFS", holds: Holds::Other, is: |s| s.says("version https://git-lfs"),
        advice: "get the file itself by `git lfs pull`" },
    Other { name: "compressed (gzip)", holds: Holds::Other, is: |s| s.is(b"\x1f\x8b"), advice: "unpack it by `gunzip FILE`" },
    Other { name: "a ZIP archive", holds: Holds::Other, is: |s| s.is(b"PK\x03\x04"), advice: "unpack it and give the mesh in it" },
    Other { name: "text in UTF-16", holds: Holds::Other, is: |s| s.is(b"\xff\xfe") || s.is(b"\xfe\xff"), advice: "save it as UTF-8" },
    Other { name: "empty", holds: Holds::Other, is: |s| s.text.is_empty(), advice: "give a glTF, OBJ, STL or PLY file" },
];

/// Binary data of no known kind.
static UNKNOWN: Other = Other {
    name: "of an unknown kind",
    holds: Holds::Other,
    is: |_| true,
    advice: "meshes are glTF, OBJ, STL or PLY files; Blender, MeshLab or `assimp export` convert others",
};

/// Finds the kind of a file by its first bytes; what has none that are known is OBJ if it has
/// vertices or its name says so.
pub(super) fn kind(file: &str, bytes: &[u8]) -> Kind {
    let head = &bytes[..bytes.len().min(4096)];
    let plain = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let start = Start { bytes, text: String::from_utf8_lossy(plain).to_ascii_lowercase() };
    let ends = |ending: &str| file.to_ascii_lowercase().ends_with(ending);
    if start.says("ply\n") || start.says("ply\r") {
        return Kind::Ply;
    }
    let solid = start.says("solid") && start.text.contains("facet");
    if super::stl::is_binary(bytes) || solid || (start.says("solid") && ends(".stl")) {
        return Kind::Stl;
    }
    match KINDS.iter().find(|k| (k.is)(&start)) {
        Some(other) => Kind::Other(other),
        None if ends(".stl") => Kind::Stl,
        None if ends(".obj") || has_vertices(bytes) => Kind::Obj,
        None => Kind::Other(&UNKNOWN),
    }
}

/// Whether a line starts as a vertex of OBJ does.
fn has_vertices(bytes: &[u8]) -> bool {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let starts = |line: &[u8]| matches!(line.trim_ascii_start(), [b'v', b' ' | b'\t', ..]);
    bytes.split(|b| matches!(b, b'\n' | b'\r')).any(starts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zip(name: &str, rest: &[u8]) -> Vec<u8> {
        let mut bytes = b"PK\x03\x04".to_vec();
        bytes.resize(26, 0);
        bytes.extend((name.len() as u16).to_le_bytes());
        bytes.extend([0, 0]);
        [&bytes, name.as_bytes(), rest].concat()
    }

    /// The name of a kind that is not read.
    fn other(bytes: &[u8]) -> &'static str {
        match kind("a", bytes) {
            Kind::Other(other) => other.name,
            known => panic!("{known:?}"),
        }
    }

    #[test]
    fn kinds_are_told_by_first_bytes() {
        let iges = format!("{:72}S      1\n", "part");
        let three_ds = [&b"MM"[..], &8u32.to_le_bytes(), &[0, 0]].concat();
        let cases: [(&[u8], &str); 26] = [
            (b"Kaydara FBX Binary  \0\x1a\0", "FBX"),
            (b"; FBX 7.3.0 project file\n", "FBX"),
            (b"PXR-USDC\0\0", "USD"),
            (b"#usda 1.0\n(", "USD"),
            (&zip("model.usdc", b""), "USD"),
            (b"BLENDER-v405", "a Blender file"),
            (b"BLENDER17-01v0500", "a Blender file"),
            (b"\xef\xbb\xbf<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"x\">", "COLLADA (DAE)"),
            (b"ISO-10303-21;\nHEADER;", "STEP (CAD)"),
            (iges.as_bytes(), "IGES (CAD)"),
            (b"OFF\n8 6 0\n", "OFF"),
            (b"NCOFF\n8 6 0\n", "OFF"),
            (&zip("[Content_Types].xml", b"\0\x003D/3dmodel.model\0"), "3MF"),
            (&three_ds, "3DS"),
            (b"<?xml?><X3D version='3.0'>", "X3D"),
            (b"#VRML V2.0 utf8", "VRML"),
            (b"\x80\x02}q\x00", "a Python pickle, perhaps of SMPL"),
            (&zip("v_template.npy", b""), "an archive of NumPy arrays, perhaps SMPL"),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "a picture"),
            (b"\xff\xd8\xff\xe0\0\x10JFIF", "a picture"),
            (b" {\"joints\": []}", "JSON, but not glTF"),
            (b"# .PCD v0.7 - Point Cloud", "a PCD cloud of points"),
            (b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"),
            (b"<!DOCTYPE html><html>", "a web page"),
            (b"  \n", "empty"),
            (b"what\0ever", "of an unknown kind"),
        ];
        for (bytes, name) in cases {
            assert_eq!(other(bytes), name);
        }
        let is_obj = |text: &str| matches!(kind("a", text.as_bytes()), Kind::Obj);
        assert!(is_obj("# offset\no solid\nv 0 0 0\n") && is_obj("\u{feff}v 0 0 0\r\n"));
        assert!(matches!(kind("a.OBJ", b"nothing"), Kind::Obj));
        assert!(matches!(kind("a.STL", b"\0 a header \0"), Kind::Stl));
        assert!(matches!(kind("a", b"solid\n facet normal"), Kind::Stl));
        assert!(matches!(kind("a", b"ply\r\nformat"), Kind::Ply));
    }

    #[test]
    fn the_error_says_what_to_do() {
        let fails = |bytes: &[u8]| crate::geom::MeshFile::read("a", bytes).unwrap_err().to_string();
        assert_eq!(
            fails(b"ISO-10303-21;"),
            "the file is STEP (CAD), which is not read as a mesh: export STL from FreeCAD, or run \
             `gmsh FILE -2 -o FILE.stl` (and give `unit = 0.001` for millimetres)"
        );
        let body = |bytes: &[u8]| not_an_armature("a", bytes).unwrap();
        assert!(body(b"; FBX 7.3.0").ends_with("`assimp export FILE FILE.glb`"));
        assert!(!body(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR").contains("autorig"));
        assert!(body(b"OFF\n").contains("FILE.ply") && body(b"OFF\n").contains("scene.autorig"));
        assert!(body(b"v 0 0 0\n").starts_with("an OBJ file has no joints; read it with mesh"));
        assert_eq!(not_an_armature("a", b"{}"), None);
    }
}
