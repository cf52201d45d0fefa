//! Reader of COLLADA (.dae) meshes: triangles and polygons with the transforms of their nodes, in metres.
//!
//! Coordinates keep the axes of the file, regardless of its `up_axis`: RViz and MoveIt read a URDF's meshes in this
//! way, and users check a URDF with them. Materials, normals, lights and animations are ignored.

use std::collections::BTreeMap;
use std::rc::Rc;

use nalgebra::{Matrix4, Point3, Rotation3, Translation3, Unit, Vector3, Vector4};

use super::triangles::{MAX_VERTICES, Mesh, MeshBuilder, max_triangles, too_many_triangles};
use super::xml_tree::{Element, XmlLimits, XmlTree};

/// Limit of nodes and instances that are visited, counted once per instance.
const MAX_NODES: usize = 10_000;
/// Limit of the nesting of nodes, including through instances.
const MAX_DEPTH: usize = 64;

/// Limit of the visited nodes' elements, counted once per visit.
const MAX_VISITED_ELEMENTS: usize = 1_000_000;
/// Limit of numbers in the lists of positions, counted once per reference.
const MAX_NUMBERS: usize = 3 * MAX_VERTICES;

/// Limits of a document: a mesh of many parts has a few thousand elements.
const XML_LIMITS: XmlLimits = XmlLimits { elements: 200_000, namespaces: 32 };

/// Reads a COLLADA document.
///
/// # Errors
/// A sentence, for any bytes.
pub(super) fn collada(bytes: &[u8]) -> Result<Mesh, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "not a text in UTF-8, as a COLLADA must be".to_owned())?;
    let tree = XmlTree::parse(text, XML_LIMITS)?;
    if tree.element(0).name != "COLLADA" {
        return Err(format!("its root element is `{}`, `COLLADA` expected", tree.element(0).name));
    }
    let mut document = Document {
        tree: &tree,
        ids: BTreeMap::new(),
        soups: BTreeMap::new(),
        positions: BTreeMap::new(),
        n_numbers: 0,
        max_triangles: max_triangles(bytes.len()),
        n_triangles: 0,
        mesh: MeshBuilder::of_file(bytes.len()),
    };
    for (at, element) in tree.elements().iter().enumerate() {
        if let Some(id) = element.attribute("id") {
            document.ids.entry(id).or_insert(at);
        }
    }
    document.read()
}

type Triangle = [[f64; 3]; 3];

struct Document<'a> {
    tree: &'a XmlTree,
    ids: BTreeMap<&'a str, usize>,
    /// Triangles of each geometry used, in its own coordinates.
    soups: BTreeMap<usize, Vec<Triangle>>,
    /// Positions of each `vertices` element used.
    positions: BTreeMap<usize, Rc<Vec<[f64; 3]>>>,
    /// Number of the numbers that they were read from.
    n_numbers: usize,
    max_triangles: usize,
    /// Number of triangles in all of `soups`.
    n_triangles: usize,
    mesh: MeshBuilder,
}

/// Position of a node in the traversal.
#[derive(Clone, Copy)]
struct Visit {
    element: usize,
    scene_from_parent: Matrix4<f64>,
    depth: usize,
}

impl<'a> Document<'a> {
    fn read(mut self) -> Result<Mesh, String> {
        let unit = Matrix4::new_scaling(self.meters_per_unit()?);
        let Some(scene) = self.scene()? else {
            // Without a scene, every geometry has its own coordinates.
            let tree = self.tree;
            for geometry in tree.named("geometry") {
                self.place(geometry, &unit)?;
            }
            return Ok(self.mesh.finish());
        };
        let mut visits: Vec<Visit> = Vec::new();
        let (mut n_visited, mut n_elements) = (0, 0);
        self.push_children(&mut visits, Visit { element: scene, scene_from_parent: unit, depth: 0 });
        while let Some(visit) = visits.pop() {
            n_visited += 1;
            if n_visited > MAX_NODES || visit.depth > MAX_DEPTH {
                return Err(format!("more than {MAX_NODES} nodes, or more than {MAX_DEPTH} within each other"));
            }
            n_elements += self.tree.children(visit.element).count();
            if n_elements > MAX_VISITED_ELEMENTS {
                return Err(format!("its nodes have more than {MAX_VISITED_ELEMENTS} elements"));
            }
            self.visit(visit, &mut visits)?;
        }
        Ok(self.mesh.finish())
    }

    fn meters_per_unit(&self) -> Result<f64, String> {
        let asset = self.tree.child(0, "asset");
        let Some(unit) = asset.and_then(|asset| self.tree.child(asset, "unit")) else { return Ok(1.0) };
        let Some(meter) = self.tree.element(unit).attribute("meter") else { return Ok(1.0) };
        let value: Option<f64> = meter.trim().parse().ok();
        value.filter(|value| (1e-9..=1e9).contains(value)).ok_or_else(|| format!("its unit of `{meter}` m is none"))
    }

    fn scene(&self) -> Result<Option<usize>, String> {
        let scene = self.tree.child(0, "scene");
        match scene.and_then(|scene| self.tree.child(scene, "instance_visual_scene")) {
            Some(instance) => self.target(instance, "url").map(Some),
            None => Ok(self.tree.named("visual_scene").next()),
        }
    }

    /// Returns the element that `attribute` of an element refers to.
    fn target(&self, at: usize, attribute: &str) -> Result<usize, String> {
        let element = self.tree.element(at);
        let Some(url) = element.attribute(attribute) else {
            return Err(format!("a `{}` has no {attribute}", element.name));
        };
        let id = url.strip_prefix('#').ok_or_else(|| format!("`{url}` is in another file"))?;
        self.ids.get(id).copied().ok_or_else(|| format!("no element has the id `{id}`"))
    }

    fn push_children(&self, visits: &mut Vec<Visit>, parent: Visit) {
        let children = self.tree.children(parent.element).filter(|&child| {
            matches!(
                self.tree.element(child).name.as_str(),
                "node" | "instance_node" | "instance_geometry" | "instance_controller"
            )
        });
        visits.extend(children.map(|element| Visit { element, ..parent }));
    }

    fn visit(&mut self, visit: Visit, visits: &mut Vec<Visit>) -> Result<(), String> {
        match self.tree.element(visit.element).name.as_str() {
            "node" => {
                let scene_from_parent = visit.scene_from_parent * self.parent_from_node(visit.element)?;
                self.push_children(visits, Visit { scene_from_parent, depth: visit.depth + 1, ..visit });
            }
            "instance_node" => {
                let element = self.target(visit.element, "url")?;
                if self.tree.element(element).name == "node" {
                    visits.push(Visit { element, depth: visit.depth + 1, ..visit });
                }
            }
            "instance_geometry" => {
                let geometry = self.target(visit.element, "url")?;
                self.place(geometry, &visit.scene_from_parent)?;
            }
            _ => return Err("it has skinned parts (instance_controller), which are not read".to_owned()),
        }
        Ok(())
    }

    fn parent_from_node(&self, node: usize) -> Result<Matrix4<f64>, String> {
        let mut parent_from_node = Matrix4::identity();
        for child in self.tree.children(node) {
            let element = self.tree.element(child);
            let step = match element.name.as_str() {
                "matrix" => Matrix4::from_row_slice(&numbers::<16>(element)?),
                "translate" => Translation3::from(Vector3::from(numbers::<3>(element)?)).to_homogeneous(),
                "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from(numbers::<3>(element)?)),
                "rotate" => {
                    let [x, y, z, degrees] = numbers::<4>(element)?;
                    let axis = Unit::try_new(Vector3::new(x, y, z), 1e-12);
                    axis.map_or_else(Matrix4::identity, |axis| {
                        Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
                    })
                }
                "lookat" | "skew" => return Err(format!("a node has a `{}`, which is not read", element.name)),
                _ => continue,
            };
            parent_from_node *= step;
        }
        if parent_from_node.row(3) != Vector4::new(0.0, 0.0, 0.0, 1.0).transpose() {
            return Err("a node's matrix does not end in 0 0 0 1".to_owned());
        }
        Ok(parent_from_node)
    }

    /// Adds a geometry at the pose of an instance.
    fn place(&mut self, geometry: usize, scene_from_geometry: &Matrix4<f64>) -> Result<(), String> {
        if !self.soups.contains_key(&geometry) {
            let soup = self.soup(geometry)?;
            self.soups.insert(geometry, soup);
        }
        for triangle in &self.soups[&geometry] {
            let corners = triangle.map(|at| scene_from_geometry.transform_point(&Point3::from(at)).coords.into());
            self.mesh.add(corners)?;
        }
        Ok(())
    }

    fn soup(&mut self, geometry: usize) -> Result<Vec<Triangle>, String> {
        let tree = self.tree;
        let max = self.max_triangles;
        let mut soup = Soup { triangles: Vec::new(), room: max - self.n_triangles, max };
        // A geometry without a mesh is a spline or a solid: nothing to read.
        let Some(mesh) = tree.child(geometry, "mesh") else { return Ok(soup.triangles) };
        for primitive in tree.children(mesh) {
            let kind = match tree.element(primitive).name.as_str() {
                "triangles" => Kind::Triangles,
                "polylist" => Kind::Polylist,
                "polygons" | "trifans" => Kind::Fans,
                "tristrips" => Kind::Strips,
                _ => continue,
            };
            self.add_primitive(primitive, kind, &mut soup)?;
        }
        self.n_triangles += soup.triangles.len();
        Ok(soup.triangles)
    }

    fn add_primitive(&mut self, primitive: usize, kind: Kind, soup: &mut Soup) -> Result<(), String> {
        let mut stride = 1;
        let mut vertices = None;
        for input in self.tree.children(primitive).filter(|&child| self.tree.element(child).name == "input") {
            let element = self.tree.element(input);
            let offset: usize = element
                .attribute("offset")
                .map_or(Ok(0), |offset| offset.trim().parse())
                .map_err(|_| "the offset of an input is no number".to_owned())?;
            // Real files have about four inputs.
            if offset >= 64 {
                return Err(format!("the offset {offset} of an input is beyond 63"));
            }
            stride = stride.max(offset + 1);
            if element.attribute("semantic") == Some("VERTEX") {
                vertices = Some((self.target(input, "source")?, offset));
            }
        }
        let (vertices, offset) = vertices.ok_or("a primitive has no vertices")?;
        let positions = self.positions(vertices)?;
        let counts = self.tree.child(primitive, "vcount").filter(|_| kind == Kind::Polylist);
        let counts = counts.map_or("", |counts| &self.tree.element(counts).text);
        for list in self.index_lists(primitive) {
            let mut corner = 0;
            let corners = indices(&self.tree.element(list).text, "p").enumerate().filter_map(|(n, index)| {
                match index {
                    Ok(index) if n % stride == offset => corner = index,
                    Ok(_) => {}
                    Err(problem) => return Some(Err(problem)),
                }
                let position = || positions.get(corner).copied();
                let none = || format!("corner {corner} is none of {} vertices", positions.len());
                (n % stride == stride - 1).then(|| position().ok_or_else(none))
            });
            kind.add(corners, indices(counts, "vcount"), soup)?;
        }
        Ok(())
    }

    /// Returns the `p` elements of a primitive; for a polygon with holes only its outline.
    fn index_lists(&self, primitive: usize) -> Vec<usize> {
        let children = self.tree.children(primitive);
        children
            .filter_map(|child| match self.tree.element(child).name.as_str() {
                "p" => Some(child),
                "ph" => self.tree.child(child, "p"),
                _ => None,
            })
            .collect()
    }

    /// Returns the positions of a `vertices` element, which is read once for any number of primitives.
    fn positions(&mut self, vertices: usize) -> Result<Rc<Vec<[f64; 3]>>, String> {
        if let Some(known) = self.positions.get(&vertices) {
            return Ok(Rc::clone(known));
        }
        let positions = Rc::new(self.read_positions(vertices)?);
        self.positions.insert(vertices, Rc::clone(&positions));
        Ok(positions)
    }

    fn read_positions(&mut self, vertices: usize) -> Result<Vec<[f64; 3]>, String> {
        let is_position = |&child: &usize| self.tree.element(child).attribute("semantic") == Some("POSITION");
        let input = self.tree.children(vertices).find(is_position).ok_or("vertices have no positions")?;
        let source = self.target(input, "source")?;
        let technique = self.tree.child(source, "technique_common");
        let accessor = technique.and_then(|technique| self.tree.child(technique, "accessor"));
        let array = match accessor {
            Some(accessor) => self.target(accessor, "source")?,
            None => self.tree.child(source, "float_array").ok_or("a source has no numbers")?,
        };
        let setting = |name: &str, default: usize| -> Result<usize, String> {
            let text = accessor.and_then(|accessor| self.tree.element(accessor).attribute(name));
            text.map_or(Ok(default), |text| {
                text.trim().parse().map_err(|_| format!("the {name} `{text}` is no number"))
            })
        };
        let (stride, offset) = (setting("stride", 3)?, setting("offset", 0)?);
        if stride < 3 {
            return Err(format!("positions of {stride} numbers, 3 expected"));
        }
        let (mut positions, mut position) = (Vec::new(), [0.0; 3]);
        for (at, word) in self.tree.element(array).text.split_ascii_whitespace().enumerate() {
            self.n_numbers += 1;
            if self.n_numbers > MAX_NUMBERS {
                return Err(format!("more than {MAX_NUMBERS} numbers in its lists of positions; use a coarser mesh"));
            }
            let Some(n) = at.checked_sub(offset) else { continue };
            let Some(place) = position.get_mut(n % stride) else { continue };
            *place = word.parse().map_err(|_| format!("`{word}` is no number"))?;
            if n % stride == 2 {
                positions.push(position);
            }
        }
        Ok(positions)
    }
}

/// Rule that forms triangles of corners.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Triangles,
    /// Polygons one after another, with their numbers of corners in a separate list.
    Polylist,
    /// One polygon or fan per list.
    Fans,
    Strips,
}

/// Triangles of a geometry, within the remaining limit of its file.
struct Soup {
    triangles: Vec<Triangle>,
    room: usize,
    /// Limit of the triangles of all geometries together.
    max: usize,
}

/// A corner of a primitive, or the reason why it cannot be read.
type Corner = Result<[f64; 3], String>;

impl Soup {
    fn add(&mut self, triangle: Triangle) -> Result<(), String> {
        self.room = self.room.checked_sub(1).ok_or_else(|| too_many_triangles(self.max))?;
        self.triangles.push(triangle);
        Ok(())
    }

    /// Adds a polygon as a fan about its first corner; adds nothing for fewer than three corners.
    fn add_fan(&mut self, mut corners: impl Iterator<Item = Corner>) -> Result<(), String> {
        let Some(first) = corners.next().transpose()? else { return Ok(()) };
        let Some(mut last) = corners.next().transpose()? else { return Ok(()) };
        for corner in corners {
            let corner = corner?;
            self.add([first, last, corner])?;
            last = corner;
        }
        Ok(())
    }
}

impl Kind {
    /// Adds a list of corners, which are read when they are used.
    fn add(
        self,
        mut corners: impl Iterator<Item = Corner>,
        counts: impl Iterator<Item = Result<usize, String>>,
        soup: &mut Soup,
    ) -> Result<(), String> {
        match self {
            Self::Fans => soup.add_fan(corners),
            Self::Triangles | Self::Strips => {
                let mut three = Vec::with_capacity(3);
                for corner in corners {
                    three.push(corner?);
                    if let Ok(triangle) = Triangle::try_from(&three[..]) {
                        soup.add(triangle)?;
                        three.drain(..if self == Self::Strips { 1 } else { 3 });
                    }
                }
                Ok(())
            }
            Self::Polylist => {
                for count in counts {
                    let (count, mut n) = (count?, 0);
                    soup.add_fan(corners.by_ref().take(count).inspect(|_| n += 1))?;
                    if n < count {
                        return Err("its polygons have too few corners".to_owned());
                    }
                }
                Ok(())
            }
        }
    }
}

fn numbers<const N: usize>(element: &Element) -> Result<[f64; N], String> {
    let words = element.text.split_ascii_whitespace().take(N + 1);
    let found: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let found = found.and_then(|found| <[f64; N]>::try_from(found).ok());
    found
        .filter(|found| found.iter().all(|value| value.is_finite()))
        .ok_or_else(|| format!("a `{}` needs {N} finite numbers", element.name))
}

/// Reads the numbers in the text of an element of this name.
fn indices<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = Result<usize, String>> + 'a {
    let words = text.split_ascii_whitespace();
    words.map(move |word| word.parse().map_err(|_| format!("`{word}` in a `{name}` is no index")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = include_str!("../../../fuzz/corpus/dae/scene.dae");
    const BARE: &str = include_str!("../../../fuzz/corpus/dae/bare.dae");

    fn read(text: &str) -> Result<Mesh, String> {
        collada(text.as_bytes())
    }

    #[test]
    fn nodes_and_unit_put_every_kind_of_face_in_its_place() {
        let mesh = read(SCENE).expect("it reads");
        assert_eq!(mesh.triangles.len(), 4, "one triangle, two of a polylist, one polygon");
        // Doubled along x, turned from x to y, 50 mm up, 1 m along x; the axes remain those of the file.
        let mut expected = vec![[1.0, 0.0, 0.05], [1.0, 0.2, 0.05], [0.9, 0.0, 0.05], [1.0, 0.0, 0.15]];
        for vertex in mesh.vertices {
            let is_it = |at: &[f64; 3]| (0..3).all(|k| (at[k] - vertex[k]).abs() < 1e-12);
            let found = expected.iter().position(is_it).unwrap_or_else(|| panic!("{vertex:?} of {expected:?}"));
            expected.swap_remove(found);
        }
        assert!(expected.is_empty(), "{expected:?}");
    }

    #[test]
    fn a_file_without_a_scene_is_read_as_it_is_drawn() {
        let mesh = read(BARE).expect("it reads");
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 5), "a strip of four and a fan of one");
        assert_eq!(mesh.vertices[1], [0.1, 0.0, 0.0], "metres where no unit is named");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let faults = [
            ("<COLLADA", "<!DOCTYPE x []><COLLADA"),
            ("url=\"#wedge\"", "url=\"other.dae#wedge\""),
            ("url=\"#wedge\"", "url=\"#none\""),
            ("meter=\"0.001\"", "meter=\"0\""),
            ("1 2 3</p>", "1 2 4</p>"),
            ("1 2 3</p>", "1 2 -3</p>"),
            ("<vcount>3 3<", "<vcount>3 4<"),
            ("100 0 0 0 100", "100 0 x 0 100"),
            ("100 0 0 0 100", "100 0 1e999 0 100"),
            ("stride=\"3\"", "stride=\"2\""),
            ("offset=\"1\"", "offset=\"64\""),
            ("0 0 0 1</matrix>", "0 0 1 1</matrix>"),
            ("<translate>0 0", "<translate>0"),
            ("<scale>2 1 1</scale>", "<skew>1</skew>"),
            ("<instance_geometry url=\"#wedge\"/>", "<instance_controller url=\"#wedge\"/>"),
            ("<instance_geometry url=\"#wedge\"/>", "<instance_node url=\"#outer\"/>"),
        ];
        let replaced = faults.map(|(from, to)| {
            assert!(SCENE.contains(from), "{from}");
            format!("{from} -> {to}\n  {}\n", read(&SCENE.replacen(from, to, 1)).expect_err(to))
        });
        let whole = ["<a/>", "", "<COLLADA><a>", &"<COLLADA>".repeat(65), &multiplied()];
        let whole = whole.map(|text| format!("{}\n", read(text).expect_err("refused")));
        insta::assert_snapshot!("collada", replaced.concat() + &whole.concat());
    }

    fn of_primitives(primitives: &str) -> String {
        format!(
            "<COLLADA><library_geometries><geometry><mesh><source id=\"p\"><float_array>0 0 0 1 0 0 0 1 0</float_array>\
             </source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>{primitives}</mesh>\
             </geometry></library_geometries></COLLADA>"
        )
    }

    #[test]
    fn long_lists_and_many_uses_are_refused_by_count() {
        const INPUT: &str = "<input semantic=\"VERTEX\" source=\"#v\"/>";
        let list = |kind: &str, p: &str| of_primitives(&format!("<{kind}>{INPUT}<p>{p}</p></{kind}>"));
        let long = "0 1 2 ".repeat(600_000);
        let kinds = ["triangles", "trifans", "tristrips"];
        let mut told = kinds.map(|kind| read(&list(kind, &long)).expect_err("refused")).to_vec();
        // The 60,000 numbers are read once for all primitives.
        let many = of_primitives(&format!("<triangles>{INPUT}</triangles>").repeat(2_000));
        let positions = "0 0 0 ".repeat(20_000);
        assert!(read(&many.replace("0 0 0 ", &positions)).is_ok_and(|mesh| mesh.triangles.is_empty()));
        // The numbers are read for each of the vertices that refers to them.
        let vertices =
            |k: usize| format!("<vertices id=\"v{k}\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>");
        let of = |k: usize| format!("{}<triangles>{}</triangles>", vertices(k), INPUT.replace("#v", &format!("#v{k}")));
        let many = of_primitives(&(0..200).map(of).collect::<String>());
        told.push(read(&many.replace("0 0 0 ", &positions)).expect_err("refused"));
        insta::assert_snapshot!("collada_counts", told.join("\n"));
    }

    /// Returns a document in which each node instances the next one ten times.
    fn multiplied() -> String {
        let mut nodes = String::new();
        for level in 0..20 {
            let instances = format!("<instance_node url=\"#n{}\"/>", level + 1).repeat(10);
            nodes += &format!("<node id=\"n{level}\">{instances}</node>");
        }
        format!(
            "<COLLADA><library_visual_scenes><visual_scene id=\"s\">{nodes}<node id=\"n20\"/>\
                            </visual_scene></library_visual_scenes></COLLADA>"
        )
    }

    #[test]
    fn cut_files_never_panic() {
        for text in [SCENE, BARE] {
            for length in 0..text.trim_end().len() {
                assert!(read(&text[..length]).is_err(), "{length}");
            }
        }
    }
}
