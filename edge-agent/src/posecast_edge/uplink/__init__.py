"""The one outbound link: publishes frames and events, answers questions, tells how late frames arrive."""
