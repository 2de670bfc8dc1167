//! Sessions as a front end has them.
