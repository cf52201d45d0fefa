//! Links and joints of a URDF file, with a list of the skipped parts.
//!
//! Wrong values that kinematics need become defects of their joint: they refuse the file if the joint is on the arm's
//! chain. Every other wrong part is skipped, and the skip is noted by link or joint.

use super::xml_tree::{Place, XmlLimits, XmlTree};

pub(super) use self::joint::{JointType, Range, UrdfJoint};
pub(super) use self::link::{ShapeElement, UrdfLink, UrdfShape};
use self::scan::Scan;
pub(super) use self::scan::Skipped;

mod driver;
mod joint;
mod link;
mod scan;

/// Limits of a URDF: a humanoid has about 3000 elements, one with every collision sphere 10,000.
const XML_LIMITS: XmlLimits = XmlLimits { elements: 50_000, namespaces: 64 };
/// Elements of other tools, which every reader of URDF skips.
const OF_OTHER_TOOLS: [&str; 8] =
    ["gazebo", "transmission", "ros2_control", "sensor", "plugin", "mujoco", "isaac_sim", "loop_joint"];

/// Links and joints in the order of the file.
#[derive(Clone, Debug)]
pub(super) struct UrdfFile {
    pub name: String,
    pub links: Vec<UrdfLink>,
    pub joints: Vec<UrdfJoint>,
    pub skipped: Vec<Skipped>,
}

impl UrdfFile {
    /// Reads the text of a URDF.
    ///
    /// # Errors
    /// A sentence with line and column, if the text is no URDF or if a joint names no links.
    pub fn parse(text: &str) -> Result<Self, String> {
        refuse_no_xml(text)?;
        let tree = XmlTree::parse(text, XML_LIMITS)?;
        refuse_other_roots(&tree)?;
        let root = tree.element(0);
        refuse_xacro(&tree)?;
        let mut scan = Scan::new(&tree);
        let colors = link::named_colors(&mut scan);
        let name = root.attribute("name").filter(|name| !name.is_empty()).unwrap_or("arm").to_owned();
        let mut file = Self { name, links: Vec::new(), joints: Vec::new(), skipped: Vec::new() };
        for at in tree.children(0) {
            let element = tree.element(at);
            if element.prefix == "xacro" && !["property", "arg", "macro"].contains(&element.name.as_str()) {
                scan.skip("robot", at, format!("xacro left `xacro:{}` over: skipped", element.name));
            }
            if !element.prefix.is_empty() {
                continue;
            }
            match element.name.as_str() {
                "link" => file.add_link(&mut scan, at, &colors),
                "joint" => file.joints.push(joint::read_joint(&mut scan, at)?),
                "material" => {}
                "ros2_control" | "transmission" => driver::note_offsets(&mut scan, &tree, at),
                other if OF_OTHER_TOOLS.contains(&other) => {}
                other => scan.skip("robot", at, format!("the element `{other}` is not part of URDF: skipped")),
            }
        }
        file.skipped = scan.into_skipped();
        Ok(file)
    }

    fn add_link(&mut self, scan: &mut Scan<'_>, at: usize, colors: &link::NamedColors) {
        let Some(name) = scan.element(at).attribute("name").map(str::to_owned) else {
            scan.skip("a link", at, "has no name, so that no joint can hold it: skipped".to_owned());
            return;
        };
        if let Some(first) = self.links.iter().find(|link| link.name == name) {
            let text = format!("is defined again; the definition at {} is used", first.place);
            scan.skip(&format!("link `{name}`"), at, text);
            return;
        }
        self.links.push(link::read_link(scan, at, name, colors));
    }
}

/// Refuses a text that is not XML at all.
fn refuse_no_xml(text: &str) -> Result<(), String> {
    let start = text.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
    if start.starts_with("version https://git-lfs") {
        return Err("it is a pointer of Git LFS, not the URDF itself. Fetch it with `git lfs pull`".to_owned());
    }
    if start.starts_with('<') {
        return Ok(());
    }
    Err("it is not XML, as every URDF is. Name the arm's URDF; a table of link lengths or DH parameters must be \
         written as one"
        .to_owned())
}

/// Refuses XML of other kinds.
fn refuse_other_roots(tree: &XmlTree) -> Result<(), String> {
    let root = tree.element(0);
    let has = |name: &str| tree.children(0).any(|at| tree.element(at).name == name);
    if root.name.eq_ignore_ascii_case("html") {
        return Err("it is a web page, not the URDF itself. Download the raw file".to_owned());
    }
    if root.name != "robot" {
        return Err(format!(
            "{}: the root element is `{}`, and that of a URDF is `robot`. {}",
            root.place,
            root.name,
            conversion(&root.name)
        ));
    }
    if has("group") && !has("link") {
        return Err("it is an SRDF, which names groups of joints. Name the URDF that has these joints".to_owned());
    }
    Ok(())
}

/// Returns the remedy for a robot description with another root element.
fn conversion(root: &str) -> &'static str {
    match root {
        "sdf" => "It is SDF. Convert it with the Python package `rod`: `rod -f ARM.sdf -o ARM.urdf`",
        "mujoco" => {
            "It is MJCF. Convert it with the Python package `mjcf-urdf-simple-converter`: \
             `from mjcf_urdf_simple_converter import convert; convert(\"ARM.xml\", \"ARM.urdf\")`. It makes slides \
             fixed joints: correct these in the URDF"
        }
        _ => "Convert the file to URDF first",
    }
}

/// Refuses a file that only xacro can expand. Remains in an expanded file, such as unused definitions and calls of
/// undefined macros, are skipped.
fn refuse_xacro(tree: &XmlTree) -> Result<(), String> {
    let advice = "Run xacro first: `xacro ARM.urdf.xacro > ARM.urdf`";
    let has_joints = tree.children(0).any(|at| tree.element(at).prefix.is_empty() && tree.element(at).name == "joint");
    let of_xacro = || tree.elements().iter().filter(|element| element.prefix == "xacro");
    let macros = of_xacro().filter(|element| element.name == "macro");
    let macros: Vec<&str> = macros.filter_map(|element| element.attribute("name")).collect();
    for element in of_xacro() {
        let (place, name) = (element.place, element.name.as_str());
        let expands = ["include", "if", "unless", "insert_block", "call"].contains(&name) || macros.contains(&name);
        if expands || !has_joints {
            return Err(format!("{place}: `xacro:{name}` is xacro, not URDF. {advice}"));
        }
    }
    let mut open: Vec<usize> = tree.children(0).filter(|&at| is_of_urdf(tree, at)).collect();
    while let Some(at) = open.pop() {
        let element = tree.element(at);
        let computed = element.attributes().find(|(key, value)| *key != "filename" && value.contains("${"));
        if let Some((key, value)) = computed {
            return Err(format!("{}: {key} = `{value}` is xacro, not URDF. {advice}", element.place));
        }
        open.extend(tree.children(at));
    }
    Ok(())
}

fn is_of_urdf(tree: &XmlTree, at: usize) -> bool {
    let element = tree.element(at);
    element.prefix.is_empty() && ["link", "joint"].contains(&element.name.as_str())
}

impl UrdfLink {
    /// Builds a link that only a joint names.
    pub fn implied(name: &str, place: Place) -> Self {
        Self { name: name.to_owned(), place, inertial: None, visual: Vec::new(), collision: Vec::new(), lost: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(body: &str) -> Vec<String> {
        let file = UrdfFile::parse(&format!("<robot name=\"a\">\n{body}\n</robot>")).expect("it reads");
        file.skipped.iter().map(|skipped| format!("{}: {}", skipped.owner, skipped.text)).collect()
    }

    #[test]
    fn what_other_tools_add_is_skipped_in_silence() {
        let quiet = "<link name=\"l\"><x:y xmlns:x=\"z\"/></link><gazebo reference=\"l\"><link/></gazebo>\
                     <transmission name=\"t\"><joint name=\"j\"/></transmission><material name=\"m\"/>";
        assert_eq!(told(quiet), Vec::<String>::new());
        let [wheel] = &told("<wheel/>")[..] else { panic!("one note") };
        assert!(wheel.contains("`wheel`"), "{wheel}");
    }

    #[test]
    fn files_of_other_kinds_are_named() {
        let texts = [
            "joint,a,alpha,d,theta\n1,0,1.57,0.3,0\n",
            "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
            "<!DOCTYPE html>\n<html><body>Not found</body></html>",
            "<robot name=\"a\"><group name=\"arm\"><chain base_link=\"b\" tip_link=\"t\"/></group></robot>",
            "<sdf version=\"1.7\"><model name=\"arm\"/></sdf>",
            "<?xml version=\"1.0\"?>\n<!-- arm -->\n<mujoco model=\"arm\"><worldbody/></mujoco>",
            "<COLLADA version=\"1.4.1\"/>",
        ];
        let told = texts.map(|text| UrdfFile::parse(text).expect_err("no URDF"));
        insta::assert_snapshot!("other_kinds", told.join("\n"));
    }

    #[test]
    fn what_a_driver_applies_is_named_by_its_joint() {
        let exported = "<ros2_control name=\"a\"><joint name=\"j\"><param name=\"offset\">-0.5</param>\
                        <state_interface name=\"position\"><param name=\"offset\">2048</param></state_interface>\
                        </joint>\
                        <transmission name=\"t\"><joint name=\"k\"><mechanical_reduction>1.02</mechanical_reduction>\
                        <offset>x</offset></joint></transmission></ros2_control>";
        let mut named: Vec<String> =
            told(exported).iter().map(|note| note.replace(": the driver applies", "#")).collect();
        named.sort_unstable();
        let owners: Vec<&str> = named.iter().filter_map(|note| note.split('#').next()).collect();
        let expected = [
            "mechanical_reduction = 1.02 of joint `k`",
            "offset = -0.5 of joint `j`",
            "offset = 2048 of joint `j`",
            "offset = x of joint `k`",
        ];
        assert_eq!(owners, expected);
        let quiet = exported.replace("-0.5", "0").replace("2048", "0.0").replace("1.02", "1").replace(">x<", ">0<");
        assert_eq!(told(&quiet), Vec::<String>::new());
    }

    #[test]
    fn xacro_is_refused_with_its_place() {
        for text in [
            "<robot name=\"a\" xmlns:xacro=\"x\"><xacro:macro name=\"b\"/></robot>",
            "<robot name=\"a\">\n<link name=\"${prefix}b\"/></robot>",
            "<robot name=\"a\"><joint name=\"j\"/><xacro:include filename=\"b\"/></robot>",
        ] {
            let problem = UrdfFile::parse(text).expect_err("refused");
            assert!(problem.contains("`xacro ") && problem.starts_with("line"), "{problem}");
        }
    }

    #[test]
    fn another_format_is_named() {
        let tools = [("sdf", "`rod -f"), ("mujoco", "mjcf_urdf_simple_converter"), ("model", "`model`")];
        for (root, tool) in tools {
            let problem = UrdfFile::parse(&format!("<{root}><robot name=\"a\"/></{root}>")).expect_err("refused");
            assert!(problem.contains(&format!("`{root}`")) && problem.contains(tool), "{problem}");
        }
    }
}
