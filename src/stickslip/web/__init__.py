"""The page of `stickslip web`: view, identify, compare and export logs in a browser, on this machine only.

A server (`stickslip.web.server`) serves the files of `static` and answers requests (`stickslip.web.app`). All
computation runs in separate processes (`stickslip.web.jobs`, `stickslip.web.worker`) through the public functions of
the package. The server itself computes nothing and stores everything in a folder of projects
(`stickslip.web.projects`).
"""
