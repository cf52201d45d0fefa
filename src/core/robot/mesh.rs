//! Reader of triangle meshes: STL, binary and ASCII, the vertices and faces of OBJ, and COLLADA.

use std::path::Path;

use super::collada::collada;
use super::triangles::{MAX_VERTICES, Mesh, MeshBuilder};
use crate::files::{self, FileKind};

/// Reason why a file is not a mesh.
#[derive(Debug, thiserror::Error)]
pub(super) enum MeshError {
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    #[error("is none of .stl, .obj, .dae")]
    Extension,
    #[error("is not a mesh: {0}")]
    Content(String),
}

/// Length of header and number of triangles of a binary STL.
const STL_HEADER: usize = 84;
const STL_TRIANGLE: usize = 50;

fn extension(file: &Path) -> Option<String> {
    file.extension().map(|e| e.to_string_lossy().to_ascii_lowercase())
}

/// Returns true if a file of this name has one of the formats that are read.
pub(super) fn is_readable(file: &Path) -> bool {
    matches!(extension(file).as_deref(), Some("stl" | "obj" | "dae"))
}

/// Returns true if a file of this name has one of the formats that other meshes are converted to.
pub(super) fn is_plain(file: &Path) -> bool {
    matches!(extension(file).as_deref(), Some("stl" | "obj"))
}

/// Reads `file` by its extension.
///
/// # Errors
/// [`MeshError`], for any bytes.
pub(super) fn read(file: &Path) -> Result<Mesh, MeshError> {
    let parse = match extension(file).as_deref() {
        Some("stl") => stl,
        Some("obj") => obj,
        Some("dae") => collada,
        _ => return Err(MeshError::Extension),
    };
    let mesh = parse(&files::read_bytes(file, FileKind::Mesh)?).map_err(MeshError::Content)?;
    if mesh.triangles.is_empty() {
        return Err(MeshError::Content("it has no triangles".to_owned()));
    }
    Ok(mesh)
}

/// Reads an STL. A binary file may also begin with `solid`; its length distinguishes it.
fn stl(bytes: &[u8]) -> Result<Mesh, String> {
    let declared = bytes.get(STL_HEADER - 4..STL_HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let length = declared.and_then(|n| n.checked_mul(STL_TRIANGLE)?.checked_add(STL_HEADER));
    if length == Some(bytes.len()) {
        return stl_binary(&bytes[STL_HEADER..]);
    }
    match std::str::from_utf8(bytes) {
        Ok(text) if text.trim_start().starts_with("solid") => stl_ascii(text),
        _ => Err(match length {
            Some(length) => format!("an STL of {length} bytes by its header, but {} bytes long", bytes.len()),
            None => "shorter than the header of an STL".to_owned(),
        }),
    }
}

fn stl_binary(triangles: &[u8]) -> Result<Mesh, String> {
    let mut builder = MeshBuilder::of_file(triangles.len());
    for record in triangles.chunks_exact(STL_TRIANGLE) {
        // The normal comes first; the order of the corners implies it.
        let number = |k: usize| {
            let at = 12 + 4 * k;
            f64::from(f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
        };
        builder.add([0, 1, 2].map(|corner| [0, 1, 2].map(|axis| number(3 * corner + axis))))?;
    }
    Ok(builder.finish())
}

fn stl_ascii(text: &str) -> Result<Mesh, String> {
    let mut builder = MeshBuilder::of_file(text.len());
    let mut corners = Vec::with_capacity(3);
    for (n, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("vertex") => corners.push(numbers(words, n)?),
            Some("endfacet") => {
                let found = corners.len();
                let facet = <[[f64; 3]; 3]>::try_from(std::mem::take(&mut corners))
                    .map_err(|_| format!("line {}: a facet of {found} corners, 3 expected", n + 1))?;
                builder.add(facet)?;
            }
            _ => {}
        }
    }
    if corners.is_empty() { Ok(builder.finish()) } else { Err("it ends within a facet".to_owned()) }
}

fn numbers<'a>(words: impl Iterator<Item = &'a str>, line: usize) -> Result<[f64; 3], String> {
    let found: Vec<f64> = words.take(3).map_while(|word| word.parse().ok()).collect();
    <[f64; 3]>::try_from(found).map_err(|_| format!("line {}: three numbers expected", line + 1))
}

fn obj(bytes: &[u8]) -> Result<Mesh, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "not a text, as an OBJ must be".to_owned())?;
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut builder = MeshBuilder::of_file(bytes.len());
    for (n, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") if vertices.len() == MAX_VERTICES => return Err(format!("more than {MAX_VERTICES} vertices")),
            Some("v") => vertices.push(numbers(words, n)?),
            Some("f") => {
                let corners =
                    words.map(|word| obj_corner(word, &vertices, n)).collect::<Result<Vec<[f64; 3]>, String>>()?;
                if corners.len() < 3 {
                    return Err(format!("line {}: a face of {} corners", n + 1, corners.len()));
                }
                // A polygon becomes a fan about its first corner.
                for pair in corners[1..].windows(2) {
                    builder.add([corners[0], pair[0], pair[1]])?;
                }
            }
            _ => {}
        }
    }
    Ok(builder.finish())
}

/// Returns the corner of an index such as `7`, `7/1/2` or, counted from the end, `-1`.
fn obj_corner(word: &str, vertices: &[[f64; 3]], line: usize) -> Result<[f64; 3], String> {
    let index: Option<i64> = word.split('/').next().and_then(|first| first.parse().ok());
    let at = index.and_then(|index| match index {
        1.. => usize::try_from(index - 1).ok(),
        0 => None,
        _ => vertices.len().checked_sub(usize::try_from(index.unsigned_abs()).ok()?),
    });
    at.and_then(|at| vertices.get(at).copied())
        .ok_or_else(|| format!("line {}: `{word}` is none of the {} vertices so far", line + 1, vertices.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[[f32; 3]; 3]; 4] = [
        [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 1.0]],
    ];

    fn binary(header: &str) -> Vec<u8> {
        let mut bytes = format!("{header:80}").into_bytes();
        bytes.extend((TETRAHEDRON.len() as u32).to_le_bytes());
        for triangle in TETRAHEDRON {
            bytes.extend([0; 12]);
            triangle.as_flattened().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii() -> String {
        let facet = |[a, b, c]: [[f32; 3]; 3]| {
            let vertex = |v: [f32; 3]| format!("  vertex {:e} {} {}\n", v[0], v[1], v[2]);
            format!("facet normal 0 0 0\n outer loop\n{}{}{} endloop\nendfacet\n", vertex(a), vertex(b), vertex(c))
        };
        format!("solid t\n{}endsolid t\n", TETRAHEDRON.map(facet).concat())
    }

    const OBJ: &str =
        "# t\nv 0 0 0\nv 0 1 0\nv 1 0 0 1.0\nvn 0 0 1\nf 1/1/1 2/2/1 3//1\nv 0 0 1\nf 1 3 4\nf -4 -1 -3\nf 3 2 4\n";

    #[test]
    fn the_same_body_reads_the_same_from_every_format() {
        let expected = stl(&binary("x")).expect("binary");
        assert_eq!((expected.vertices.len(), expected.triangles.len()), (4, 4), "corners are shared");
        assert_eq!(stl(&binary("solid x")).expect("binary that begins with solid"), expected);
        assert_eq!(stl(ascii().as_bytes()).expect("ascii"), expected);
        assert_eq!(obj(OBJ.as_bytes()).expect("obj"), expected);
    }

    #[test]
    fn damaged_files_are_named_and_never_panic() {
        let whole = binary("x");
        for length in 0..whole.len() {
            assert!(stl(&whole[..length]).is_err(), "{length}");
        }
        let text = ascii();
        for length in 0..text.len() {
            let _ = stl(&text.as_bytes()[..length]);
        }
        let ascii = |from: &str, to: &str| stl(text.replacen(from, to, 1).as_bytes()).expect_err("damaged");
        let mut told = vec![ascii("vertex 0", "vertex x"), ascii("  vertex 0e0 0 0\n", "")];
        let mut infinite = whole;
        infinite[STL_HEADER + 12..STL_HEADER + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
        told.push(stl(&infinite).expect_err("damaged"));
        let bad = ["f 1 2 9", "f 1 2", "f 0 1 2", "v 1 2"];
        told.extend(bad.map(|bad| obj(format!("{OBJ}{bad}\n").as_bytes()).expect_err(bad)));
        insta::assert_snapshot!("meshes", told.join("\n"));
        assert!(obj(&[0xff, 0xfe]).is_err());
    }

    #[test]
    fn many_vertices_are_refused() {
        let vertices = "v 0 0 0\n".repeat(MAX_VERTICES + 1);
        assert!(obj(&vertices.as_bytes()[..8 * MAX_VERTICES]).is_ok());
        insta::assert_snapshot!("many_vertices", obj(vertices.as_bytes()).expect_err("refused"));
    }

    #[test]
    fn files_are_told_apart_by_their_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).expect("written");
            read(&folder.path().join(name))
        };
        assert!(write("a.STL", &binary("x")).is_ok());
        assert!(matches!(write("a.ply", &binary("x")), Err(MeshError::Extension)));
        assert!(matches!(write("a.obj", b"v 0 0 0\n"), Err(MeshError::Content(_))));
        assert!(matches!(read(&folder.path().join("b.stl")), Err(MeshError::Unreadable(_))));
    }
}
