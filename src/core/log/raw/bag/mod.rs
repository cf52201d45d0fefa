//! Every readable message of a ROS 2 bag in an SQLite file (`.db3`), without SQLite.
//!
//! A bag consists of a few tables that need no query engine: rows are read in the order of their numbers, in which they
//! were written. `pages` finds a page in the file, or in the log of writes that a killed recorder leaves next to it
//! (`write_ahead_log`). `tree` iterates over the rows of a table, `row` has their columns, whose names are in the
//! table's declaration (`declaration`). `messages` knows the tables of rosbag2. Source: "Database File Format",
//! sqlite.org.
//!
//! No length or page number is trusted. Each page is read once in a pass, so that the work is proportional to the
//! file's size, regardless of the references between pages. The data unpacked from a page are never longer than the
//! page.

mod declaration;
mod messages;
mod numbers;
mod pages;
mod row;
mod tree;
mod write_ahead_log;

#[cfg(test)]
mod tests;

pub use messages::{BagFiles, SecondBagPass, bag_contents, scan_bag};
