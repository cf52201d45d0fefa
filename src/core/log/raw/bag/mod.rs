//! Every readable message of a ROS 2 bag in an SQLite file (`.db3`), without SQLite.
//!
//! A bag is a few tables without anything that a query engine is needed for: rows are read in the order that they were
//! written in, which is that of their numbers. `pages` finds a page in the file, or in the log of writes that a killed
//! recorder leaves beside it (`write_ahead_log`); `tree` walks the rows of a table, `row` has their columns, whose
//! names are in the table's declaration (`declaration`); `messages` knows the tables of rosbag2. Source: "Database File
//! Format", sqlite.org.
//!
//! No length or page number is trusted. Each page is looked at once in a pass, so that the work is that of the file's
//! size, whatever its pages say of each other; what is unpacked from a page is never longer than the page.

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
