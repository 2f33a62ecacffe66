"""An oscilloscope in the browser: one page, and streams relayed to it.

`site` answers pages and questions, `tab` is one page's WebSocket, `hub` the one stream that all
tabs of a runner share; `door` decides who comes in.
"""
