//! Tags that do not fit their survey.
//!
//! `departure` tests each tag's estimate against its survey. `group` finds tags that moved together, `alike` those that
//! one motion displaced, `identity` tags of another size or with another's id. `freed` holds the tags that are
//! estimated without their survey, and reports them.

pub(crate) mod alike;
pub(crate) mod departure;
pub(crate) mod freed;
pub(crate) mod group;
pub(crate) mod identity;
