//! Tests of sessions, used as by a front end.
