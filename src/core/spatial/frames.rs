//! The frames, each defined once. All are right-handed.

/// A marker type that names a coordinate frame.
pub trait Frame: Copy + Clone + std::fmt::Debug + 'static {}

macro_rules! frame {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct $name;
        impl Frame for $name {}
    };
}

frame!(
    /// The ground: origin at the vehicle's station, z up, x along the vehicle's mean heading.
    World
);
frame!(
    /// The vehicle's body: origin at its centre of mass, x forward, y to port, z up.
    Vehicle
);
frame!(
    /// The arm's base link: origin on the first joint's axis; its axes are those of the URDF's base link, z up.
    Base
);
frame!(
    /// A link of the arm, as the URDF defines it (origin on its parent joint).
    Link
);
frame!(
    /// The tool: origin at the tool point, axes of the link that carries it.
    Tool
);
frame!(
    /// The wrist camera's optical frame: x right, y down, z forward along the optical axis.
    Camera
);
frame!(
    /// A tag: origin at its centre, x right and y up as printed, z out of the tag towards the viewer.
    Tag
);
